"""Forces on the joint coordinates: controller, effects, and user-defined forces."""
