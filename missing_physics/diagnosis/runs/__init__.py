"""What closed-loop simulations say of explanations: likelihoods, numbers and their intervals."""
