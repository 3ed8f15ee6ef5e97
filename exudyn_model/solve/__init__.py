"""A run in Exudyn: the tree as an Exudyn system, time integration, channels and sensors."""
