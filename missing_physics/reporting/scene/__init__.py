"""A robot in three dimensions, moving: lines, boxes and bent links."""
