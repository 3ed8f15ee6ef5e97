"""A moving robot in 3-D: lines, boxes and bent links."""
