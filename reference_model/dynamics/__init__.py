"""The tree of bodies, its recursion and the equations of motion, as expressions."""
