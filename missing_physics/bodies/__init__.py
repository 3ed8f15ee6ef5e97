"""Inertial parameters of bodies: whether they are physically consistent, and writing them to a robot file."""
