"""The commands, one file each; every one has `register`, which adds it to the command line."""
