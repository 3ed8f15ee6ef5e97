"""MJCF, the format of MuJoCo (mujoco.readthedocs.io, XML reference).

The compiler's rules for a rigid tree on joints are followed; content without a counterpart in the robot
description is noted.
"""

from robot_model.formats.mjcf.reading import read_mjcf

__all__ = ["read_mjcf"]
