"""Motion of a free base: measured rates, and its response to forces, momentum and changed bodies."""
