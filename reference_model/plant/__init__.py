"""The robot as it is: its effects gathered, and the closed loop as ordinary differential equations."""
