"""Map files: where in a foreign file each native channel comes from, in which unit, and corrections of it."""
