"""The commands, one file each; every file has `register`, which adds it to the command line."""
