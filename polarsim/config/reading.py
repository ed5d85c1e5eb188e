"""Configurations from files, from mappings and from assignments on the command line."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from polarsim.config.model import Config
from polarsim.errors import ConfigError, with_path
from polarsim.formats.yaml_files import describe_error, parse_yaml, read_yaml
from polarsim.randomness import without_negative_zeros
from polarsim.render.options import RenderOptions

RELEASE_ROOT = "POLAR_SIM_ROOT"  # environment variable that names a local copy of the release


def parse_config(content: Mapping[str, Any]) -> Config:
    """Check a configuration."""
    if endless := [f"{key}: should be a finite number, found {value}" for key, value in _not_finite(content, "")]:
        raise ConfigError("; ".join(endless))
    try:
        return Config.model_validate(_with_release_root(without_negative_zeros(dict(content))))
    except ValidationError as error:
        raise ConfigError(describe_error(error, "configuration")) from error


def read_config(path: str | Path) -> Config:
    """Read a configuration file."""
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise ConfigError("no keys, expected a configuration", path=path)
    with with_path(path):
        return parse_config(content)


def render_options(assignments: Sequence[str]) -> RenderOptions:
    """Return render options from `key=value`, such as `materials.default.principled.roughness=0.5`.

    Values are YAML, for example `gain={hapke: 150}`. Later assignments override earlier ones.
    """
    content: dict[str, Any] = {}
    for assignment in assignments:
        key, value = parse_assignment(assignment)
        *sections, last = key.split(".")
        part = content
        for section in sections:
            inner = part.get(section)
            part[section] = part = dict(inner) if isinstance(inner, dict) else {}
        part[last] = value
    try:
        return RenderOptions.model_validate(content)
    except ValidationError as error:
        raise ConfigError(describe_error(error, "options")) from error


def parse_assignment(assignment: str) -> tuple[str, Any]:
    """Return key and value of `KEY=VALUE` with the value in YAML."""
    key, equals, text = assignment.partition("=")
    if not key or not equals:
        raise ConfigError(f"{assignment!r}: expected KEY=VALUE")
    try:
        return key, parse_yaml(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"{key}: {text!r} is not a YAML value") from error


def config_schema() -> str:
    """Return the JSON schema of the configuration; editors use the copy in `config/schema.json`."""
    return json.dumps(Config.model_json_schema(), indent=1, sort_keys=True) + "\n"


def _not_finite(content: Any, key: str) -> Iterator[tuple[str, float]]:
    """Yield key and value of every infinite or NaN number."""
    if isinstance(content, float) and not math.isfinite(content):
        yield key, content
    elif isinstance(content, Mapping):
        for name, inner in content.items():
            yield from _not_finite(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(content, (list, tuple)):
        for number, inner in enumerate(content):
            yield from _not_finite(inner, f"{key}.{number}")


def _with_release_root(content: dict[str, Any]) -> dict[str, Any]:
    source = content.get("source")
    root = os.environ.get(RELEASE_ROOT)
    if root and isinstance(source, Mapping) and source.get("kind") == "release":
        return {**content, "source": {**source, "root": root}}
    return content
