"""What a figure's pixels say: whether it is there, and whether data are drawn on it."""

import numpy as np

from polarsim.formats import png


def is_drawn(path, width=600):
    """A picture of the wanted width with more than a blank page on it; axis labels alone are enough."""
    pixels = png.read(path)
    assert pixels.shape[1] == width
    return (pixels[..., :3] < 128).any()


def coloured(path):
    """Share of a picture's pixels that have a colour: data are drawn in colours, axes, text and notes in grey."""
    pixels = png.read(path)[..., :3].astype(int)
    return (np.ptp(pixels, axis=-1) > 40).mean()
