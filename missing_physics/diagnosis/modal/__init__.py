"""Vibration of flexible links along a recorded motion: state space, Kalman filter and smoother."""
