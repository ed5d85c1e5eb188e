"""Browser page of a run."""
