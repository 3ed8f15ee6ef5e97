"""Answers against the truth, and two engines' answers against each other."""
