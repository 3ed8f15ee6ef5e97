"""What a diagnosis says, as everything that shows or scores it reads it."""
