"""What may be missing: the standard model with effects at places, and which effects may be added to it."""
