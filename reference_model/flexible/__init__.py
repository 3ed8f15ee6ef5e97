"""Flexible links: finite elements, modes and the constant integrals that the recursion needs."""

from reference_model.flexible.body import FlexibleBody, flexible_body

__all__ = ["FlexibleBody", "flexible_body"]
