"""Stage 4, seed labels to labels of every photo: boxes, polygons and grey maps."""
