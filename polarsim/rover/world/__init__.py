"""Undisturbed ground and rocks: stitched terrains, elevation models and random practice grounds."""
