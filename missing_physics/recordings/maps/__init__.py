"""Map files: where in a foreign file each native channel comes from, in which unit, and how to mend a map."""
