"""A second kind of detector: depth from a pair of photos, against the depth of the meshes."""
