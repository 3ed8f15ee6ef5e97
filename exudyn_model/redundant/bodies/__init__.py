"""Bodies of the redundant formulation in Exudyn, and their points of attachment for joints and forces."""
