"""Schema of the configuration for the Snakemake workflow catalogue: YAML without references, which it does not follow.

The file documents the keys. It validates nothing: `parse_config` does.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import yaml

from polarsim.config import config_schema

HEADER = (
    "# Keys of a configuration, for the Snakemake workflow catalogue. Written by `make schema`; polarsim checks more.\n"
)


class _WithoutAliases(yaml.SafeDumper):
    """Writes repeated parts in full."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def catalogue_schema() -> str:
    """Return the schema of `polarsim schema` as YAML in which each definition stands where it is used."""
    schema = json.loads(config_schema())
    definitions = schema.pop("$defs")
    whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", **_resolved(schema, definitions)}
    return HEADER + yaml.dump(whole, Dumper=_WithoutAliases, allow_unicode=True, sort_keys=False, width=120)


def _resolved(part: Any, definitions: dict[str, Any]) -> Any:
    """Return a part of a schema with definitions instead of references; keys next to a reference are kept."""
    if isinstance(part, list):
        return [_resolved(inner, definitions) for inner in part]
    if not isinstance(part, dict):
        return part
    others = {key: _resolved(inner, definitions) for key, inner in part.items() if key != "$ref"}
    if "$ref" not in part:
        return others
    return _resolved(definitions[part["$ref"].rpartition("/")[2]], definitions) | others


if __name__ == "__main__":
    sys.stdout.write(catalogue_schema())
