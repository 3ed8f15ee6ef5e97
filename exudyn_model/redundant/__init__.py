"""The robot as bodies and constraints: redundant coordinates, with Exudyn's own constraint forces."""

from exudyn_model.redundant.run import RedundantRun
from exudyn_model.redundant.watch import extra_channels

__all__ = ["RedundantRun", "extra_channels"]
