"""Tests of the pixels of a figure."""

import numpy as np

from polarsim.formats import png


def is_drawn(path, width=600):
    """Return whether an image of the given width is not blank; axis labels are sufficient."""
    pixels = png.read_png(path)
    assert pixels.shape[1] == width
    return (pixels[..., :3] < 128).any()


def coloured(path):
    """Return the share of coloured pixels; data are coloured, axes, text and notes are grey."""
    pixels = png.read_png(path)[..., :3].astype(int)
    return (np.ptp(pixels, axis=-1) > 40).mean()
