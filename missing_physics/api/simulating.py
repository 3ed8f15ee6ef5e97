"""A robot's reference motion, run by one of the engines."""

from __future__ import annotations

from typing import Literal

from missing_physics.api.loading import PathLike, RobotLike, load_robot
from robot_model import InputError, Recording

__all__ = ["simulate"]


def simulate(
    robot: RobotLike,
    *,
    engine: Literal["reference", "exudyn"] = "reference",
    overlay: PathLike | None = None,
    seed: int = 0,
    truth: bool = False,
) -> Recording:
    """Run the reference motion of a robot, and record what its sensors measure.

    Args:
        robot: as for `load_robot`.
        engine: ``reference`` or ``exudyn``; they share only the robot's description.
        overlay: as for `load_robot`.
        seed: of the sensors' noise.
        truth: return every channel without errors instead of the sensors' recordings.

    Returns:
        Channels of shape (N,) in SI units over `time` [s].

    Raises:
        InputError: the robot cannot be read or run, or there is no such engine.
    """
    model = load_robot(robot, overlay=overlay)
    if engine == "exudyn":
        import exudyn_model

        return exudyn_model.simulate(model, seed=seed, sensors=not truth)
    if engine != "reference":
        raise InputError(f"there is no engine '{engine}'; choose reference or exudyn.")
    from reference_model.simulation import simulate as run

    return run(model, seed=seed, sensors=not truth)
