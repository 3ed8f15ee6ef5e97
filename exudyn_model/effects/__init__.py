"""Effects of the Exudyn model: the formulas of the catalogue, written a second time on their own.

`laws_of`, `added_masses` and `sensor_faults` sort a robot's effects by what they change. An effect without
a counterpart here is refused by name before anything runs.
"""

from __future__ import annotations

from exudyn_model.effects.build import check_effects, laws_of

__all__ = ["check_effects", "laws_of"]
