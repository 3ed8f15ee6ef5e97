"""Printed output: the summary, an inspection, tables and plots of characters."""
