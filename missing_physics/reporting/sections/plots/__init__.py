"""Sections with figures: what was tried, and the residual over time, place and frequency."""
