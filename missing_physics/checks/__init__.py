"""Whether recordings can be used for what is asked of them: their channels, clocks and drives."""
