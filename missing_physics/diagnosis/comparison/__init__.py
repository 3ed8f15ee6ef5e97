"""Comparison of the answer with the nominal robot file and with the standard identification model."""
