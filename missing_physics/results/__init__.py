"""The result of a diagnosis, as read by everything that shows or scores it."""
