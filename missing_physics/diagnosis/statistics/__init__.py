"""Least squares where errors are correlated in time: blocks, folds and tests."""
