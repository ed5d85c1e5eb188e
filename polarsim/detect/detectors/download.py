"""Weights to start from that are not on the disk yet; only where the configuration names an address."""

from __future__ import annotations

import hashlib
import logging
from pathlib import Path

from polarsim.detect.options import TrainingOptions
from polarsim.download import alone, downloaded
from polarsim.errors import FetchError

log = logging.getLogger("polarsim")


def ensure_weights(options: TrainingOptions) -> None:
    """Fetch `pretrained` from `pretrained_url` where it is missing.

    Raises
    ------
    FetchError
        No such address, or another file than `pretrained_sha256` pins.
    """
    if options.start_weights and options.pretrained_url and not options.start_weights.is_file():
        assert options.pretrained_sha256, "options are checked"
        fetch(options.pretrained_url, options.start_weights, options.pretrained_sha256)


def fetch(url: str, path: Path, sha256: str) -> None:
    """Write what an address gives, if it has this checksum; see `downloaded` for its tries."""
    log.info("fetching %s", url)
    with alone(path.parent):
        if path.is_file():  # another training's job was here
            return
        with downloaded(url, path) as partial, partial.open("rb") as content:
            found = hashlib.file_digest(content, "sha256").hexdigest()
            if found != sha256.lower():
                raise FetchError(f"{url}: SHA-256 {found}, expected {sha256}")
