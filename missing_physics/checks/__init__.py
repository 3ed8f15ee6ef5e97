"""Checks whether recordings can be used for a diagnosis: channels, clocks and drives."""
