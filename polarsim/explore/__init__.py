"""A run as a page in the browser, as a Rerun recording, and as a FiftyOne data set: read from its files alone."""
