"""The rover itself: one table of its parts, and where its cameras are."""
