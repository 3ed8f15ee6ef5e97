"""The independent reference engine: recursive multibody dynamics as CasADi expressions."""
