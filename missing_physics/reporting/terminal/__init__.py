"""Printed output: the summary, an inspection, tables and character plots."""
