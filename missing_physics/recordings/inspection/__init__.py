"""Problems of a recording, and what can be identified from it: one check per file."""
