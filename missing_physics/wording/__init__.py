"""How numbers read, wherever they are printed."""
