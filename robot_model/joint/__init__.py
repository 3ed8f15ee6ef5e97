"""Actuator, clearance and temperature of a joint, as data."""
