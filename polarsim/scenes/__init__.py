"""Randomised training scenes: rocks of a terrain on generated sand, rendered with exact labels.

1. `options`: number of scenes, and the ranges of the random parameters.
2. `layout`: sand, and rocks on it; `viewpoints`: camera and lamps.
3. `render_scenes`: images, masks and labels, with a dark hall outside the walls and traces of erased `strokes`.
"""
