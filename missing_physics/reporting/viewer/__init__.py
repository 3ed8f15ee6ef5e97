"""The rerun file and the initial layout of its viewer."""
