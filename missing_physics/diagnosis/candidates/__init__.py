"""Effects that may be missing, each at its places, with numbers from which a fit starts."""
