"""Stage 5, meshes and cameras to twins of every photo, with exact labels."""
