"""The sealed truth, what a challenge keeps on disk, and what has to agree once a seal is open."""
