"""Controllers as data, by kind."""
