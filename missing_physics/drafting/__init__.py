"""Drafts of maps and overlays: the probable meaning of a log's columns, with reasons and open questions."""

from missing_physics.drafting.draft import Draft, draft

__all__ = ["Draft", "draft"]
