"""Configuration of a site alone, and values of a draft that a person must fill in."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from polarsim.config import Config, parse_config
from polarsim.errors import ConfigError
from polarsim.formats.yaml_files import read_yaml
from polarsim.running.configuration import read_configs
from polarsim.site import Site
from polarsim.site_parts import FILL_IN

_SUFFIXES = (".yaml", ".yml")


def checked_config(site: str, root: Path | None) -> Config:
    """Return the configuration in a file, or the default configuration of a site, with data below a root."""
    path = Path(site)
    if is_configuration(site):
        return read_configs([path], [] if root is None else [f"source={json.dumps({'root': str(root)})}"])
    return parse_config({"site": site, "source": {"kind": "files", "root": str(root or ".")}})


def is_configuration(site: str) -> bool:
    """Return whether a text is the path of a configuration, not a site."""
    return Path(site).suffix in _SUFFIXES and not _is_site(read_yaml(site))


def values_to_fill_in(site: str) -> list[tuple[str, str]]:
    """Return key and description of the values of a site file that are still marked."""
    path = Path(site)
    if path.suffix not in _SUFFIXES:
        return []
    content = read_yaml(path)
    if isinstance(content, Mapping) and not _is_site(content):
        inner = content.get("site")
        return values_to_fill_in(str(inner)) if isinstance(inner, str) else list(_marked(inner or {}, "site"))
    return list(_marked(content, ""))


def _is_site(content: object) -> bool:
    if not isinstance(content, Mapping):
        raise ConfigError("no keys, expected a site or a configuration")
    return "source" not in content and "site" not in content and bool(set(content) & set(Site.model_fields))


def _marked(content: object, key: str) -> Iterator[tuple[str, str]]:
    if isinstance(content, str) and content.startswith(FILL_IN):
        yield key, content.removeprefix(FILL_IN).lstrip(": ") or "a value"
    elif isinstance(content, Mapping):
        for name, inner in content.items():
            yield from _marked(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(content, list):
        for inner in content:
            yield from _marked(inner, key)
