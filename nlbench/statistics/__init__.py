"""From the tracks of a block to the tables of an experiment: sums, totals, summaries and claims."""
