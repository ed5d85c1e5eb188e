"""Views of a run's files: browser page, Rerun recording, FiftyOne data set."""
