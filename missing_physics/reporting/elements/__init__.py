"""What all writers share: numbers, verdicts and tables in words, figures, colours, curves."""
