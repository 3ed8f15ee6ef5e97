"""Waves over position that are too fast for the band of the motion, such as ripple of motors and gears."""
