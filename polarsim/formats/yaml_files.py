"""YAML files that hold a pydantic model, and what is wrong with them in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from polarsim.errors import ConfigError
from polarsim.formats.files import packaged
from polarsim.formats.readers import reader

Model = TypeVar("Model", bound=BaseModel)


@reader("YAML file", largest_mb=1, error=ConfigError)
def read_yaml(path: str | Path) -> Any:
    """What a YAML file holds; one of `config/` may be that which came with polarsim (see `files.packaged`).

    Raises
    ------
    ConfigError
        No file, or no YAML.
    """
    return yaml.safe_load(packaged(path).read_text(encoding="utf-8"))


@reader("YAML file", largest_mb=1, error=ConfigError)
def read_model(path: str | Path, model: type[Model], whole: str) -> Model:
    """The model that a YAML file holds; `whole` names it where no single key is wrong.

    Raises
    ------
    ConfigError
        No YAML, unknown or missing keys, impossible values: one line with the file and each key.
    """
    content = read_yaml(path)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(describe_error(error, whole), path=path) from error


def describe_error(error: ValidationError, whole: str) -> str:
    """All problems in one line; those of no single key are the `whole`'s."""
    return "; ".join(
        f"{'.'.join(str(part) for part in problem['loc']) or whole}{_reason(problem)}" for problem in error.errors()
    )


def _reason(problem: Any) -> str:
    known = {"extra_forbidden": ": unknown key", "missing": ": missing", "union_tag_not_found": ".kind: missing"}
    if problem["type"] in known:
        return known[problem["type"]]
    found = problem.get("input")
    text = problem["msg"].removeprefix("Value error, ").removeprefix("Input ")
    ours = problem["type"] == "value_error"  # such a text may say already what was found
    if isinstance(found, (dict, BaseModel)) or (ours and str(found) in text):
        return f": {text}"
    return f": {text}, found {found!r}"
