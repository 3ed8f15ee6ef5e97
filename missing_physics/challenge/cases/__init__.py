"""What a case is: its family, what is hidden in it and how strongly, and its number."""
