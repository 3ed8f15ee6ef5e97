"""Parts of what a diagnosis says."""
