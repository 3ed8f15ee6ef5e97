"""CasADi functions as compiled C, kept between runs, and called with little overhead."""
