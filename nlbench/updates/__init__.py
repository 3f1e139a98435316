"""Updates: a prior and a measurement give a posterior.

`tempering_rates` and `two_step_rates` are the pseudo-time rates of two of them, between full arrays.
"""

from nlbench.updates.exposed import tempering_rates, two_step_rates

__all__ = ["tempering_rates", "two_step_rates"]
