"""Updates: a prior and a linearised measurement give a posterior."""
