"""Effects and numbers found by closed-loop simulations alone."""
