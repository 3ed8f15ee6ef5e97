"""The answer next to the robot file as it came and to the standard identification model."""
