"""Temperature, losses and clearance of joints."""
