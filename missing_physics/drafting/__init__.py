"""Drafts of maps and overlays: what a log's columns probably are, why, and what remains to be asked."""

from missing_physics.drafting.draft import Draft, draft

__all__ = ["Draft", "draft"]
