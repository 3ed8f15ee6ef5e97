"""What a run in Exudyn is made of besides the system itself."""
