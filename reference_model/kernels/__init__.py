"""Dynamics as loops over bodies: one function for all bodies of a class, called for each."""

from reference_model.kernels.looped import LOOPED_FROM, looped_rate, rate_by_size

__all__ = ["LOOPED_FROM", "looped_rate", "rate_by_size"]
