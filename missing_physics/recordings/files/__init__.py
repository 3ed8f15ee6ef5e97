"""From a file to a recording, and back."""
