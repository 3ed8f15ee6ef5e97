"""Compiles the loops around the peers, separately from the timing; they are cached until a version changes.

    python -m benchmarks.speed.build

The loop around Pinocchio's headers takes g++ a minute or more, the others a second.
"""

from __future__ import annotations

import sys
import time

from benchmarks.speed.loops import mujoco_loop, pinocchio_loop
from benchmarks.speed.rigid_peers import random_states
from reference_model.flexible.undeformed import undeformed
from robot_model import load_robot

__all__ = ["main"]

ROBOT = "two_link_arm"


def main() -> None:
    """Make every loop once, and report the time."""
    robot = undeformed(load_robot(ROBOT))
    states = random_states(robot)
    for name, make in (("MuJoCo", mujoco_loop), ("Pinocchio", pinocchio_loop)):
        start = time.perf_counter()
        make(robot, states)
        print(f"loop around {name}: {time.perf_counter() - start:.1f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
