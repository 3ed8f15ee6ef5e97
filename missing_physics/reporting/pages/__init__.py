"""HTML pages that need no network: the report, an effect, a challenge."""
