"""Angular rates of a free base measured by gyros, and causes of deviations from momentum conservation."""
