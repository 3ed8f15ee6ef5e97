"""Generation of the files of a case from its design."""
