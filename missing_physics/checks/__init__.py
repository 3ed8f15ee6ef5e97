"""Whether recordings can be used for a diagnosis: their channels, clocks and drives."""
