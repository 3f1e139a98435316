"""Experiment files: their schema, loading with positions, and identity. Loads no numerical library."""

from nlbench.config.claim import Claim
from nlbench.config.load import from_dict, load
from nlbench.config.overrides import Override
from nlbench.config.plugged import allow
from nlbench.config.schema import Experiment, FilterSpec

__all__ = ["Claim", "Experiment", "FilterSpec", "Override", "allow", "from_dict", "load"]
