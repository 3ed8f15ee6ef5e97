"""Joint motion and torque of a recording, and the filter applied to both."""
