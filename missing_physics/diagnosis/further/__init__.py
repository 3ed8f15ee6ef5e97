"""Sensors other than torque: findings, errors, and how they are merged into the diagnosis."""
