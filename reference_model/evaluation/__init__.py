"""The dynamics of a robot evaluated over whole recordings, or one state at a time."""
