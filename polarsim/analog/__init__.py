"""The simulated sandbox: a terrain with photos, scans, calibration and seeds in NASA's formats, and its ground truth.

1. presets, ground (`noise`), rocks, placement: sand and rocks of a terrain; sandbox: walls, hall and their materials;
   terrain puts them together.
2. stations: rig, calibration with errors, tripod positions and lamps.
3. scanner: range maps and clouds with noise and mixed pixels.
4. view (`rays`): the surface at every pixel; light: direct light and penumbrae; bounce: one diffuse reflection.
5. sensor: lens faults, glare, noise, 12 bits; photographer: the photos of all keys.
6. regions, annotator: visible regions, and the seeds that a person draws from them.
7. truth: true cameras, meshes, labels and albedo. `generate` runs all steps.
"""
