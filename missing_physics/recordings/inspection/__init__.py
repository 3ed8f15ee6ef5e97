"""Problems of a recording, and what can be identified from it: one check in each file."""
