"""Effects: each left-out phenomenon in a file of its own. See `base` for the interface."""
