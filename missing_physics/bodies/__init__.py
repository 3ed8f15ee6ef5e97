"""Inertial parameters of bodies, and whether they are physically consistent."""
