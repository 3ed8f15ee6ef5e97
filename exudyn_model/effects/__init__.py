"""Effects of the Exudyn model: the formulas of the catalogue, implemented independently.

`effects_of` sorts a robot's effects by what they change: forces at joints, masses and gravity, channels. An
effect without a counterpart here is refused by name before anything runs.
"""

from __future__ import annotations

from exudyn_model.effects.build import Effects, effects_of, require_bodies

__all__ = ["Effects", "effects_of", "require_bodies"]
