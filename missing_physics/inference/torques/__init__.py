"""Rows of torques: recordings in the band of the motion, and what each effect contributes there."""
