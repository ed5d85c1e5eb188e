"""Type of paths in a configuration."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator


def _expanded(value: object) -> object:
    """Replace a leading `~` or `~user` of a path by the home folder, as a shell does."""
    text = os.fspath(value) if isinstance(value, str | Path) else ""
    if not isinstance(value, str | Path):
        return value  # rejected by pydantic
    if not text.strip() or "\0" in text:
        raise ValueError("an empty path")
    expanded = os.path.expanduser(text)  # noqa: PTH111, the type of the value must stay: unions of pydantic depend on it
    if text.startswith("~") and expanded == text:
        raise ValueError("no home folder of this user")
    return type(value)(expanded)


UserPath = Annotated[Path, BeforeValidator(_expanded)]
