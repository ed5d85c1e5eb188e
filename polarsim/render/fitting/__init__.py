"""Fit of the materials of a terrain to photos.

1. exposures: merge an exposure bracket into a linear image with variance; separate the lamps.
2. samples: select lit, unclipped pixels away from edges, with their geometry.
3. search: fit model parameters and darkening to cells of samples.
4. texels: albedo of every vertex and brightness of every lamp, by robust least squares.
5. fit: all steps in order, validation on the held-out azimuth, and the files.
"""
