"""Masks as COCO's runs: lengths of background and foreground in turn, down the columns, as text of six bits a sign.

pycocotools writes the same bytes (a test compares both), but encodes whole images: 2.9 ms instead of 0.7 ms for a rock
of 60 x 80 px. It also reads beyond the end of broken text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polarsim.errors import FormatError
from polarsim.photo import HEIGHT, WIDTH

_FIRST = 48  # code of the sign that stands for 0
_VALUE, _SIGN, _GOES_ON = 0x1F, 0x10, 0x20  # bits of a sign's number; the sign of a run's last one; more to come
_LONGEST = 7  # signs of one run: 35 bits, more than any picture has pixels


@dataclass(frozen=True)
class Rle:
    """Runs of a mask of a whole picture, compressed as COCO's own tools do it."""

    height: int
    width: int
    counts: str

    @cached_property
    def area(self) -> int:
        """Number of its pixels."""
        return int(self._runs()[1::2].sum())

    def mask(self) -> np.ndarray:
        """(h, w) bool."""
        runs = self._runs()
        return np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(self.width, self.height).T

    def _runs(self) -> np.ndarray:
        return checked(_runs_of(self.counts), self.height, self.width)


def encode(mask: np.ndarray, left: int = 0, top: int = 0, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Rle:
    """Runs of a part (h, w) of a mask, with its first pixel at (left, top) of a picture (width, height) else empty."""
    width, height = size
    assert left >= 0
    assert top >= 0
    assert top + mask.shape[0] <= height
    assert left + mask.shape[1] <= width
    padded = np.pad(np.asarray(mask, np.int8).T, ((0, 0), (1, 1)))
    step = np.diff(padded, axis=1)
    index = (np.arange(mask.shape[1])[:, None] + left) * height + np.arange(mask.shape[0] + 1) + top
    starts, ends = index[step == 1], index[step == -1]
    apart = starts[1:] != ends[:-1]  # a run that leaves a column at its foot goes on at the head of the next
    starts, ends = starts[np.append(True, apart)[: len(starts)]], ends[np.append(apart, True)[: len(ends)]]
    borders = np.append(np.stack([starts, ends], axis=1).ravel(), width * height)
    runs = np.diff(borders, prepend=0)
    return Rle(height, width, _text_of(runs if runs[-1] else runs[:-1]))


def from_runs(runs: Sequence[int], size: tuple[int, int] = (WIDTH, HEIGHT)) -> Rle:
    """Lengths of runs, background first, of a picture (width, height).

    Raises
    ------
    FormatError
        Runs below 0, or that do not fill the picture.
    """
    return Rle(size[1], size[0], _text_of(checked(np.array(runs, np.int64), size[1], size[0])))


def from_text(counts: str, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Rle:
    """Compressed runs of a picture (width, height).

    Raises
    ------
    FormatError
        Signs that no run has, or runs that do not fill the picture.
    """
    checked(_runs_of(counts), size[1], size[0])
    return Rle(size[1], size[0], counts)


def checked(runs: np.ndarray, height: int, width: int) -> np.ndarray:
    """The runs, if they fill a picture of this size."""
    if (runs < 0).any() or runs.sum() != height * width:
        raise FormatError(f"runs of {runs.sum()} pixels, expected {width} x {height}, none below 0")
    return runs


def _text_of(runs: np.ndarray) -> str:
    """Every run less the last but one before it (from the fourth on), five bits a sign, low ones first."""
    left = np.array(runs, np.int64)
    left[3:] -= runs[1:-2]
    signs = np.zeros((len(left), _LONGEST), np.uint8)
    used = np.zeros(signs.shape, bool)
    more = np.ones(len(left), bool)
    for number in range(_LONGEST):
        value = left & _VALUE
        left >>= 5
        ends = np.where(value & _SIGN, left == -1, left == 0)  # what is left is the sign of the bits written
        signs[:, number] = _FIRST + value + np.where(ends, 0, _GOES_ON)
        used[:, number] = more
        more &= ~ends
    assert not more.any()
    return signs[used].tobytes().decode("ascii")


def _runs_of(text: str) -> np.ndarray:
    """(n,) int64 lengths."""
    codes = np.frombuffer(text.encode("utf-8"), np.uint8).astype(np.int64) - _FIRST
    if not len(codes):
        return np.zeros(0, np.int64)
    ends = codes & _GOES_ON == 0
    starts = np.append(True, ends[:-1])
    index = np.arange(len(codes)) - np.flatnonzero(starts)[np.cumsum(starts) - 1]
    if codes.min() < 0 or codes.max() >= 2 * _GOES_ON or not ends[-1] or index.max() >= _LONGEST:
        raise FormatError("text that encodes no runs")
    runs = np.add.reduceat((codes & _VALUE) << (5 * index), np.flatnonzero(starts))
    negative = codes[ends] & _SIGN != 0
    runs -= np.where(negative, 1 << (5 * (index[ends] + 1)), 0)
    runs[1::2], runs[2::2] = np.cumsum(runs[1::2]), np.cumsum(runs[2::2])
    return runs
