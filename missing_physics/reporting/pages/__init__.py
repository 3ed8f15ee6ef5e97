"""Self-contained HTML pages: the report, an effect, a challenge."""
