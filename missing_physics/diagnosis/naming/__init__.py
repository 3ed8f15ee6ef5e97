"""Which effects explain the residual, how probable each is, and with which numbers."""
