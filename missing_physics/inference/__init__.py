"""Which physics recordings are evidence of: models fitted by their likelihood."""
