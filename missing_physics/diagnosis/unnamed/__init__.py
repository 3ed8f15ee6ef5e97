"""Forces that no named law explains: curves over coordinates, and what the names leave unexplained."""
