"""Performance of the filters as ratios to a frozen kernel, compared with a baseline."""
