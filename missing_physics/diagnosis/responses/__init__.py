"""What effects add to torques and channels along a recorded motion."""
