"""Inverse dynamics along a recorded motion, and predictions of gyros."""
