"""Laws of effects that act on links and the base: bending, loads, pushes, walls."""
