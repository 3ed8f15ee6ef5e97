"""What is wrong with a recording, and what it can tell: one check in each file."""
