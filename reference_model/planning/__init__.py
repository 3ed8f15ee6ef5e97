"""Reference motions that are found by optimisation."""
