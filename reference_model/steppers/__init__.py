"""Time integration of the closed loop under error control."""
