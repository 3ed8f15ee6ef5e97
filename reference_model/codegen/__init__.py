"""CasADi functions as compiled C, cached between runs, and called with little overhead."""
