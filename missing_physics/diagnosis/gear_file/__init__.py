"""Findings on transmissions: merged into the diagnosis and the robot file."""
