"""Randomised training scenes: rocks of a terrain on generated ground, rendered with exact labels.

1. `options`: number, kind and size of the scenes, and the ranges of the random parameters of the sandbox.
2. Sandbox: `layout`, sand and rocks on it; `viewpoints`, camera and lamps.
3. Field: `field_options`, ranges of the random parameters; `field_view`, camera and nodes of the ground;
   `field_ground`, its heights and albedo; `field_rocks`, rocks, gravel and parts of vehicles; `field_effects`, texture,
   sky and compression; `field_scenes`, images.
4. `render_scenes`: images, masks and labels; of the sandbox with a dark hall outside the walls and traces of erased
   `strokes`. `scene_image`: labelled image, and contrast of labels.
"""
