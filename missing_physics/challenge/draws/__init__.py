"""What is drawn for a case from its number."""
