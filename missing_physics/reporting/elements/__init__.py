"""Elements shared by all writers: numbers, verdicts and tables as text, figures, colours, curves."""
