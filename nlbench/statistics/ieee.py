"""Arithmetic as IEEE 754 has it, without warnings: what has no value is NaN, what is too large infinite."""

import numpy as np

ieee = np.errstate(divide="ignore", invalid="ignore", over="ignore")
