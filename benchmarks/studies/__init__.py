"""Studies of the systems that the introduction of the paper on joint friction of space robots names."""
