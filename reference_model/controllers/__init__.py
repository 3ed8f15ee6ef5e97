"""Control laws beyond joint PD, computed torque and voltage servos."""
