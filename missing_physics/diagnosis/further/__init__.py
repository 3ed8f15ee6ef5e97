"""What sensors beside those of torque say: findings, errors, and how they join the diagnosis."""
