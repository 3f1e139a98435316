"""Updates: a prior and a measurement give a posterior. Each is a function of the prior and the linearised measurement."""
