"""The simulated sandbox: photos, scans, calibration and seeds of a terrain in NASA's formats, and the ground truth.

1. presets, ground, rocks, placement: sand and rocks of a terrain; sandbox: walls, hall and materials;
   terrain combines them.
2. stations: rig, calibration with errors, tripod positions and lamps.
3. scanner: range maps and clouds with noise and mixed pixels.
4. view (`rays`): surface at every pixel; light: direct light and penumbrae; bounce: one diffuse reflection.
5. sensor: lens effects, glare, noise, 12 bits; photographer: photos of all keys.
6. regions, annotator: visible regions, and simulated human annotations (seeds).
7. truth: true cameras, meshes, labels and albedo. `generate` runs all steps.
"""
