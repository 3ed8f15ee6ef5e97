"""Free runs: the closed loop as an expression in a robot's numbers, simulated along recordings."""
