"""Forms in which a run leaves the project: one catalogue of what it made, written for the readers that people have."""
