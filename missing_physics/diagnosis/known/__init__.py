"""Corrects recordings for known effects of sensors and gears before hypotheses are weighed."""
