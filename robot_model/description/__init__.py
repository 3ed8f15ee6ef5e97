"""Types of a robot description, their consistency checks, and the type of recordings."""
