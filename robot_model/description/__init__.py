"""What a robot is: its types, what must hold among them, and what a recording of it is."""
