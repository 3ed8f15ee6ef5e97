"""A Kalman filter of the standard model at full rate, for comparison with the rows in a band."""
