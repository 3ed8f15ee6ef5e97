"""The yardstick: every real machine with its fitted and held-out runs, and known effects."""

from benchmarks.yardstick.loading import Loaded, load, robot_of
from benchmarks.yardstick.machines import Known, Machine, Run, machine, rows

__all__ = ["Known", "Loaded", "Machine", "Run", "load", "machine", "robot_of", "rows"]
