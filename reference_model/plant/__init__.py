"""The true robot: its effects collected, and the closed loop as ordinary differential equations."""
