"""Fixed steps: a robot stepped by a loop of the user, or over a complete motion."""
