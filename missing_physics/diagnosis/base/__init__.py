"""How a free base turns by its gyros, and what makes it turn otherwise than momentum demands."""
