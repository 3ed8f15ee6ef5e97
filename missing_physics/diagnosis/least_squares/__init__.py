"""Recorded torques as a least-squares problem, and explanations fitted to it."""
