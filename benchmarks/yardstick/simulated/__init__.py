"""The simulated yardstick: one engine's answers to 300 drawn cases, and comparison of two engines."""
