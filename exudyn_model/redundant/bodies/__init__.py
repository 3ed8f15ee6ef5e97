"""Bodies of the redundant formulation in Exudyn, and where joints and forces hold them."""
