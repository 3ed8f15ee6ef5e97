"""Recordings and motions as used: without dead channels, and without the part beyond a long gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from missing_physics.coverage.dead import dead_channels, without_dead
from missing_physics.motion.estimate import Motion
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.motion.recorded import make_dynamics
from robot_model import Recording, Robot

__all__ = ["Prepared", "prepared"]


@dataclass(frozen=True)
class Prepared:
    """The prepared data.

    Attributes:
        recordings: without dead channels and unused parts.
        dynamics: of the nominal robot along each recording.
        dead: channels that were removed, with the reason.
    """

    recordings: tuple[Recording, ...]
    dynamics: tuple[MotionDynamics, ...]
    dead: Mapping[str, str] = field(default_factory=dict)


def prepared(
    robot: Robot, recordings: Sequence[Recording], *, cutoff: float | None = None, as_recorded: bool = False
) -> Prepared:
    """Estimate motion and nominal dynamics, and remove what cannot be used.

    Args:
        robot: the nominal robot.
        recordings: as read.
        cutoff: of the filter [Hz]; found from the data when None.
        as_recorded: believe every channel.

    Raises:
        InputError: see `make_dynamics`.
    """
    every, along = tuple(recordings), make_dynamics(robot, recordings, cutoff=cutoff)
    dead = {} if as_recorded else dead_channels(robot, every, along)
    if dead:
        every = without_dead(every, dead)
        along = make_dynamics(robot, every, cutoff=cutoff)
    used = tuple(_used(one, dynamics.motion) for one, dynamics in zip(every, along))
    return Prepared(used, along, dead)


def _used(recording: Recording, motion: Motion) -> Recording:
    """The part of a recording over which the motion was estimated."""
    if not motion.left_out:
        return recording
    half = 0.5 / motion.low_pass.rate
    return recording.window(float(motion.time[0]) - half, float(motion.time[-1]) + half)
