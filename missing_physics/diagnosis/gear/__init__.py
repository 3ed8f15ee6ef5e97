"""The difference between a motor encoder and a joint encoder, and its causes."""
