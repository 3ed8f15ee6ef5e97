"""Torques of a robot along an exactly known motion."""
