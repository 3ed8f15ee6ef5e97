"""Robots simulated in closed loop along the references of recordings."""
