"""Digest of the options that can change a result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from polarsim.acquire.options import SeedOptions
from polarsim.config.sections import Sections
from polarsim.site import polar

_FOLDERS = {"corrections", "views"}  # options that name a folder of data


def config_digest(config: Sections) -> str:
    """Return the digest of `Config.digest`."""
    content = config.model_dump(exclude=_without_effect(config))
    if config.domains_to_fit and config.render.set_to_default:
        content["set_to_default"] = config.render.set_to_default
    text = json.dumps(_without_places(content), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _without_effect(config: Sections) -> dict[str, Any]:
    """Return the options that change no result of this run, in the form of pydantic's `exclude`."""
    unused = {
        "analog": not config.data_source.is_generated,
        "detect": not (config.domains or config.covers.run or config.rover.run),
        "gap": not config.gap.components,
        "covers": not config.covers.run,
        "rover": not config.rover.run,
    }
    parts: dict[str, Any] = {
        "source": {"root", "urls"},
        "labels": {"seeds": {"root"}} if isinstance(config.labels.seeds, SeedOptions) else set(),
        "detect": {"elsewhere"},
        "covers": {"publish"},
        "rover": {"bags": True, "cameras": {"videos"}},
    }
    unused["site"] = config.site == polar()
    return {
        "run": True,
        "publish": True,
        "scoring": True,
        **parts,
        **{name: True for name, without in unused.items() if without},
    }


def _without_places(value: Any, key: str = "") -> Any:
    """Return options as JSON values in which a file is replaced by its name and a folder by `given`."""
    if isinstance(value, Mapping):
        return {name: _without_places(part, name) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_without_places(part, key) for part in value]
    if isinstance(value, Path):
        return "given" if key in _FOLDERS else value.name
    # The default may be an integer and the file contain a float; -0.0 equals 0.0.
    return float(value) + 0.0 if isinstance(value, int | float) and not isinstance(value, bool) else value
