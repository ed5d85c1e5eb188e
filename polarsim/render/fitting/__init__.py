"""Materials of a terrain from its photos.

1. exposures: an exposure bracket to one linear image with its variance; images of single lamps.
2. samples: pixels that are lit, unclipped and away from edges, with their geometry.
3. search: parameters of the models and darkening, by cells of samples.
4. texels: albedo of every vertex and brightness of every lamp, by robust least squares.
5. fit: the steps in order, the check on the azimuth that is held out, and the files.
"""
