"""The likelihood measured: spectra of residuals, calibration of the score, and coverage of intervals."""
