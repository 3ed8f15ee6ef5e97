"""MJCF, the format of MuJoCo (mujoco.readthedocs.io, XML reference).

Followed are the compiler's rules for what a rigid tree on joints consists of; what a robot's description has
no place for is noted.
"""

from robot_model.formats.mjcf.reading import read_mjcf

__all__ = ["read_mjcf"]
