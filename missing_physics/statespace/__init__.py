"""A recording as a realisation of a stochastic state-space model: its rows, noise and likelihood."""
