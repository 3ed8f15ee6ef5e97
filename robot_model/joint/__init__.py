"""What a joint may have besides its motor and its bearing."""
