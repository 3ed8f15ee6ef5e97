"""Inverse dynamics along a recorded motion, and what further channels measure of it."""
