"""Forces without a name, for physics that is not in the catalogue: curves, memory, coupling of joints."""

from missing_physics.unnamed.curves import CURVES
from missing_physics.unnamed.force import UnknownForce
from missing_physics.unnamed.memory import MEMORIES
from missing_physics.unnamed.neighbours import driven_by

__all__ = ["CURVES", "MEMORIES", "UnknownForce", "driven_by"]
