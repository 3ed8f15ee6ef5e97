"""The simulated yardstick: one engine's answers to 300 drawn cases, and two engines' side by side."""
