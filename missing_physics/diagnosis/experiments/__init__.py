"""Motions that would separate explanations which these recordings cannot."""
