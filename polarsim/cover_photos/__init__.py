"""Published cover photos: cleaned, assigned to a photo key, and used to evaluate and fine-tune detectors."""
