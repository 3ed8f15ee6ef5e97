"""Channels: names, raw variables, noise and resolution, decimation."""
