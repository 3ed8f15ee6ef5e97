"""Map files: source and unit of each native channel in a foreign file, and corrections."""
