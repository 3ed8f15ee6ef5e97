"""Forces on the joint coordinates: controller, effects, and forces from outside the description."""
