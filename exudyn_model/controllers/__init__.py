"""Control laws, by kind."""
