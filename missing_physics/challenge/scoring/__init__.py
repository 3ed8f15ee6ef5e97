"""Comparison of answers with the truth, and of the answers of two versions of the diagnosis."""
