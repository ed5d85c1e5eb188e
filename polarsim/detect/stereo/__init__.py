"""A second kind of judge: depth from a pair of photos, against the depth of the meshes."""
