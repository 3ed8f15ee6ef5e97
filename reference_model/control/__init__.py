"""Control laws, the reference motions that they follow, and the model that they carry."""
