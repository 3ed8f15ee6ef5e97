"""Known effects of sensors and gears, for which recordings are corrected before hypotheses are weighed."""
