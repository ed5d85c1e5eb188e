"""Stereo depth of pairs of photos or twins, compared with the depth of the meshes."""
