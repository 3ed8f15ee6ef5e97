"""Control laws, the reference motions that they follow, and the nominal models that they carry."""
