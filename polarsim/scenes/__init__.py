"""Randomised training scenes: rocks of one terrain on generated sand, rendered with exact labels.

1. `options`: number of scenes, and the ranges that each is drawn from.
2. `relief`, `layout`: sand, and rocks on it; `viewpoints`: camera and lamps.
3. `render_scenes`: images, masks and labels; with `background` behind the walls and traces of erased `strokes`.
"""
