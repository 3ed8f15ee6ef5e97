"""The interface for scripts and notebooks, which `missing_physics` exports."""

from missing_physics.api.diagnosing import Answer, diagnose
from missing_physics.api.inspecting import Inspection, inspect
from missing_physics.api.loading import load_recording, load_robot
from missing_physics.api.simulating import simulate

__all__ = ["Answer", "Inspection", "diagnose", "inspect", "load_recording", "load_robot", "simulate"]
