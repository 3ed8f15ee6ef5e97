"""The error of a diverging run, with its last state."""

from __future__ import annotations

from collections.abc import Sequence

from robot_model import InputError, Robot

__all__ = ["diverged"]


def diverged(
    robot: Robot, time: float, joints: Sequence[str], position: Sequence[float], velocity: Sequence[float]
) -> InputError:
    """The error of a motion that diverges after `time` [s].

    Args:
        robot: the simulated robot.
        time: of the last instant that could be computed.
        joints: names, in the order of `position` [rad or m] and `velocity` [rad/s or m/s] at that instant.
    """
    words = ", ".join(f"{name} at {q:.4g} moving {v:.4g}" for name, q, v in zip(joints, position, velocity))
    return InputError(
        f"robot '{robot.name}': the motion diverges after {time:.6g} s ({words}); "
        "lower the controller's gains, its sample_time or the time step."
    )
