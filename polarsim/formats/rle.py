"""COCO run-length encoding of masks: alternating lengths of background and foreground runs in column-major order.

The compressed text has six bits per character. pycocotools writes the same bytes (a test compares both) but encodes
complete images: 2.9 ms instead of 0.7 ms for a rock of 60 x 80 px. It also reads past the end of invalid text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polarsim.errors import FormatError

_ZERO = 48  # code of the character for 0
_VALUE, _NEGATIVE, _CONTINUED = 0x1F, 0x10, 0x20  # bits of a character: value; sign, in the last character; continued
_MAX_CHARACTERS = 7  # per run: 35 bits, enough for the number of pixels of any image


@dataclass(frozen=True)
class Rle:
    """Mask of an image as compressed runs, identical to those of COCO's tools."""

    height: int
    width: int
    counts: str

    @cached_property
    def area(self) -> int:
        """Number of foreground pixels."""
        return int(self._runs()[1::2].sum())

    def mask(self) -> np.ndarray:
        """Return the mask (h, w), bool."""
        runs = self._runs()
        return np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(self.width, self.height).T

    def _runs(self) -> np.ndarray:
        return _checked(_runs_of(self.counts), self.height, self.width)


def encode_rle(mask: np.ndarray, size: tuple[int, int], left: int = 0, top: int = 0) -> Rle:
    """Encode a mask (h, w) that covers a part of an image (width, height), with the first pixel at (left, top)."""
    width, height = size
    assert left >= 0
    assert top >= 0
    assert top + mask.shape[0] <= height
    assert left + mask.shape[1] <= width
    padded = np.pad(np.asarray(mask, np.int8).T, ((0, 0), (1, 1)))
    step = np.diff(padded, axis=1)
    index = (np.arange(mask.shape[1])[:, None] + left) * height + np.arange(mask.shape[0] + 1) + top
    starts, ends = index[step == 1], index[step == -1]
    separate = starts[1:] != ends[:-1]  # a run at the bottom of a column can continue at the top of the next column
    starts, ends = starts[np.append(True, separate)[: len(starts)]], ends[np.append(separate, True)[: len(ends)]]
    borders = np.append(np.stack([starts, ends], axis=1).ravel(), width * height)
    runs = np.diff(borders, prepend=0)
    return Rle(height, width, _text_of(runs if runs[-1] else runs[:-1]))


def from_runs(runs: Sequence[int], size: tuple[int, int]) -> Rle:
    """Encode lengths of runs, background first, of an image (width, height)."""
    return Rle(size[1], size[0], _text_of(_checked(np.array(runs, np.int64), size[1], size[0])))


def from_text(counts: str, size: tuple[int, int]) -> Rle:
    """Return the mask of compressed runs of an image (width, height)."""
    _checked(_runs_of(counts), size[1], size[0])
    return Rle(size[1], size[0], counts)


def _checked(runs: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return the runs after a check that they fill an image of this size."""
    if (runs < 0).any() or runs.sum() != height * width:
        raise FormatError(f"runs of {runs.sum()} pixels, expected {width} x {height} pixels and no negative run")
    return runs


def _text_of(runs: np.ndarray) -> str:
    """Compress runs: from the fourth run, differences to the run two before; 5 bits per character, low bits first."""
    rest = np.array(runs, np.int64)
    rest[3:] -= runs[1:-2]
    characters = np.zeros((len(rest), _MAX_CHARACTERS), np.uint8)
    used = np.zeros(characters.shape, bool)
    more = np.ones(len(rest), bool)
    for number in range(_MAX_CHARACTERS):
        value = rest & _VALUE
        rest >>= 5
        ends = np.where(value & _NEGATIVE, rest == -1, rest == 0)  # the rest equals the sign of the written bits
        characters[:, number] = _ZERO + value + np.where(ends, 0, _CONTINUED)
        used[:, number] = more
        more &= ~ends
    assert not more.any()
    return characters[used].tobytes().decode("ascii")


def _runs_of(text: str) -> np.ndarray:
    """Return the lengths (n,) int64 of compressed runs."""
    codes = np.frombuffer(text.encode("utf-8"), np.uint8).astype(np.int64) - _ZERO
    if not len(codes):
        return np.zeros(0, np.int64)
    ends = codes & _CONTINUED == 0
    starts = np.append(True, ends[:-1])
    index = np.arange(len(codes)) - np.flatnonzero(starts)[np.cumsum(starts) - 1]
    if codes.min() < 0 or codes.max() >= 2 * _CONTINUED or not ends[-1] or index.max() >= _MAX_CHARACTERS:
        raise FormatError("the text is no compressed run-length encoding")
    runs = np.add.reduceat((codes & _VALUE) << (5 * index), np.flatnonzero(starts))
    negative = codes[ends] & _NEGATIVE != 0
    runs -= np.where(negative, 1 << (5 * (index[ends] + 1)), 0)
    runs[1::2], runs[2::2] = np.cumsum(runs[1::2]), np.cumsum(runs[2::2])
    return runs
