"""Common parts of the readers of robot formats: drafts, markup, mass properties, poses, notes."""
