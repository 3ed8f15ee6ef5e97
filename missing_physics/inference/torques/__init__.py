"""Rows of torques: recordings in the band of the motion, and the contribution of each effect to them."""
