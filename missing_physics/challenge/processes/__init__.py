"""The processes in which the steps of a case run, and how far each is isolated."""
