"""Channels: their names, raw variables, noise and resolution, fewer samples."""
