"""What is printed: the summary, an inspection, tables and plots of characters."""
