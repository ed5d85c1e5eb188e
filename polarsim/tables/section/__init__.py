"""Sentences of a results section, each following from a run's tables, and the page that they stand on."""
