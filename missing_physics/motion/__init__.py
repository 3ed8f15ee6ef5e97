"""The motion in a recording as its sensors give it, and the dynamics of a robot along it."""
