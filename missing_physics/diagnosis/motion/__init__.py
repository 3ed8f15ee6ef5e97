"""The joint motion and the torque of a recording, and the filter that both pass."""
