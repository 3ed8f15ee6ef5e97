"""Effects on links and the base: bending, loads, outer forces, walls."""
