"""Findings between two encoders: in the diagnosis and in the robot file."""
