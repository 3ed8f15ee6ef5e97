"""Control laws, their reference motions, and their nominal model."""
