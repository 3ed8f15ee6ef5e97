"""Effects: one file for each phenomenon that a model may lack. See `base` for the interface."""
