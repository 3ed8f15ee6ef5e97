"""Inertial numbers of bodies: which are those of real ones, and how a robot file gets them."""
