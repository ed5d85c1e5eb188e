"""Fit of the light of the lamps and of the materials of a terrain to photos.

1. exposures: merge an exposure bracket into a linear image with variance; separate the lamps.
2. samples: select lit, unclipped pixels away from edges, with their geometry; terrain: of all photos of a terrain.
3. light: light fields of the Sun lamps, from the samples of all terrains, tested on left-out terrains.
4. search: fit model parameters to cells of samples.
5. texels: albedo of every vertex and brightness of every lamp, by robust least squares.
6. fit: materials of a terrain, steps 1, 2, 4 and 5 in order, validation on the held-out azimuth, and the files.
"""
