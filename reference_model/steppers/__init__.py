"""Methods that move a robot on by steps of a fixed length."""
