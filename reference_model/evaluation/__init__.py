"""The dynamics of a robot evaluated over complete recordings, or one state at a time."""
