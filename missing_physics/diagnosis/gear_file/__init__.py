"""Gears that were found, in the robot file and in closed-loop simulations."""
