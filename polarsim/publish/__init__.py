"""Export of a run to public data formats: a catalogue of the run's files, and a writer per format."""
