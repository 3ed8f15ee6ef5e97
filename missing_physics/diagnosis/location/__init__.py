"""Where, when and on what the residual depends."""
