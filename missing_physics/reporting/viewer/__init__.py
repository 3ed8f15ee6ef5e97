"""The rerun file and what the viewer opens on."""
