"""A rigid free-flyer with gyros, recorded for a few seconds with hidden effects."""

from __future__ import annotations

from collections.abc import Sequence

from floating_cases import flyer

from missing_physics.diagnosis.base.stage import BaseResult, diagnose_base
from missing_physics.motion.recorded import make_dynamics
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot


def small(**changes: object) -> Robot:
    """The flyer without friction, in a short recording."""
    return flyer(8.0).model_copy(update={"effects": (), **changes})


def recorded(robot: Robot, *effects: EffectUse, seed: int = 92001) -> Recording:
    """A recording of the robot with effects that its file does not list."""
    return simulate(robot.with_effects(*effects), seed=seed)


def diagnosed(robot: Robot, recordings: Sequence[Recording], *, cutoff: float | None = 2.5) -> BaseResult:
    """What the gyros say of a robot file, in a band up to `cutoff` [Hz]."""
    along = make_dynamics(robot, recordings, cutoff=cutoff)
    found = diagnose_base(robot, recordings, len(recordings), along=along)
    assert found is not None
    return found
