"""Numbers and effects of a robot refined until its free runs follow the recordings."""
