"""Configuration files: overlays merged into one configuration, and the stored configuration of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from polarsim.config import Config, parse_assignment, parse_config
from polarsim.errors import ConfigError, with_part
from polarsim.formats.files import packaged, resolve_packaged, write_text
from polarsim.formats.yaml_files import read_yaml

BASE = Path("config/config.yaml")  # the configuration that overlays are applied to
DEFAULT_RUN = "demo"
STORED = "config.yaml"  # in the folder of a run
_HEADER = "# Configuration of the last call of this run, with all overlays and --config. Written by the workflow.\n"
_SETTINGS = "--config"


def base_configuration(files: Iterable[Path]) -> list[Path]:
    """Return `BASE` if the files are overlays; an empty list if a file defines `source.kind`."""
    return [] if any(_defines_source(_mapping(path)) for path in files) else [BASE]


def read_configs(files: Sequence[Path], settings: Sequence[str] = ()) -> Config:
    """Merge configuration files and settings; later values override earlier values.

    Files without `source.kind` are applied to `BASE`. Settings are texts `KEY=VALUE` with the value in YAML, as of
    `--config`.
    """
    chosen = [*base_configuration(files), *files]
    content: dict[str, Any] = {}
    set_by_hand: dict[str, Any] = {}
    for setting in settings:
        with with_part(_SETTINGS):
            key, value = parse_assignment(setting)
        _merge(set_by_hand, {key: value})
    for part in (*map(_mapping, chosen), set_by_hand):
        _merge(content, part)
    return check_config(content, chosen, set_by_hand)


def config_of_module(content: Mapping[str, Any], placed: Callable[[str], str]) -> Config:
    """Validate the configuration that another workflow gives to polarsim as a module.

    Without `source.kind` it is an overlay of the packaged `BASE`: a file of this name in the folder is the other
    workflow's.
    `placed` is the effect of the module's `prefix` on a path. Paths that it changes become absolute, because the prefix
    is for results, not for the files that the configuration names.
    """
    whole: dict[str, Any] = {}
    if not _defines_source(content):
        _merge(whole, _mapping(packaged(BASE)))
    _merge(whole, content)
    try:
        config = parse_config(whole)
    except ConfigError as error:
        error.reason = f"module polarsim, config: {error.reason}"
        raise

    def kept(path: Path) -> Path:
        return path if placed(str(path)) == str(path) else resolve_packaged(path).absolute()

    located: Config = _with_paths(config, kept)
    return located


def check_config(
    content: Mapping[str, Any], files: Iterable[Path], settings: Mapping[str, Any] | None = None
) -> Config:
    """Validate a merged configuration; an error names the files with the invalid keys."""
    try:
        return parse_config(content)
    except ConfigError as error:
        if error.path is not None:  # another file, such as that of the site
            raise
        parts = [(_shown(path), _mapping(path)) for path in files] + ([(_SETTINGS, settings)] if settings else [])
        names = _holders(error, parts)
        if len(names) == 1:
            error.path = Path(names[0])
        elif names:
            error.reason = f"{', '.join(names)}: {error.reason}"
        raise


def store_config(config: Config, run: Path) -> None:
    """Store the configuration of a run in the folder of the run; an equal file is not written again."""
    content = config.model_dump(mode="json", exclude_unset=True)
    text = _HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=1000)
    path = run / STORED
    if not path.is_file() or path.read_bytes() != text.encode():
        write_text(path, text)


def config_of_run(run: Path, files: Sequence[Path] = ()) -> Config:
    """Return the configuration of a run: from files if given, else the stored configuration.

    Relative paths of a stored configuration are valid in every working folder.
    """
    stored = run / STORED
    if files:
        config = read_configs(files)
    elif stored.is_file():
        config = _located(check_config(_mapping(stored), [stored]), run.absolute().parent.parent)
    else:
        raise ConfigError(
            "the run has no stored configuration: add --configfile, or repeat `polarsim run`, which stores the "
            "configuration",
            path=stored,
        )
    if config.run != run.absolute().name:
        names = ", ".join(map(_shown, files or [stored]))
        raise ConfigError(f"{names}: configuration of run {config.run!r}, expected run {run.name!r}")
    return config


def run_and_config(results: Path, run: str | None, files: Sequence[Path] = ()) -> tuple[Path, Config]:
    """Return the folder and the configuration of a run; default name: from the files, else `demo`."""
    from polarsim.arguments import run_folder  # imports Typer, which a plan does not need

    name = run if run is not None else read_configs(files).run if files else DEFAULT_RUN
    folder = run_folder(results, name)
    return folder, config_of_run(folder, files)


def _located(config: Config, folder: Path) -> Config:
    """Convert paths relative to a folder to paths that are valid in the working folder."""
    located: Config = _with_paths(config, lambda path: folder / path if (folder / path).exists() else path)
    return config if folder == Path.cwd() else located


def _with_paths(part: Any, change: Callable[[Path], Path]) -> Any:
    """Return a part of a configuration with changed paths."""
    if isinstance(part, BaseModel):
        found = {name: _with_paths(getattr(part, name), change) for name in type(part).model_fields}
        return part.model_copy(update={name: value for name, value in found.items() if value != getattr(part, name)})
    if isinstance(part, dict):
        return {key: _with_paths(value, change) for key, value in part.items()}
    if isinstance(part, tuple):
        return tuple(_with_paths(value, change) for value in part)
    return change(part) if isinstance(part, Path) else part


def _shown(path: Path) -> str:
    """Return a path for messages: relative if it is below the working folder."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _defines_source(content: Mapping[str, Any]) -> bool:
    """Return whether a configuration is complete; overlays may change other keys of `source`, such as `scans`."""
    source = content.get("source")
    return isinstance(source, Mapping) and "kind" in source


def _mapping(path: Path) -> Mapping[str, Any]:
    content = read_yaml(resolve_packaged(path))
    if not isinstance(content, Mapping):
        raise ConfigError("no keys, expected a configuration", path=path)
    return content


def _merge(content: dict[str, Any], other: Mapping[str, Any]) -> None:
    for key, value in other.items():
        if isinstance(value, Mapping):
            inner = content.get(key)
            content[key] = inner = dict(inner) if isinstance(inner, Mapping) else {}
            _merge(inner, value)
        else:
            content[key] = value


def _holders(error: ConfigError, parts: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Return the names of the parts with the keys of an error; all parts if the error has no key."""
    cause = error.__cause__
    problems = cause.errors() if isinstance(cause, ValidationError) else []
    found = set()
    for problem in problems:
        depths = [_depth(content, problem["loc"]) for _, content in parts]
        if not any(depths) or problem["type"] == "missing":
            return [name for name, _ in parts]
        found.add(max(number for number, depth in enumerate(depths) if depth == max(depths)))
    return [parts[number][0] for number in sorted(found)] or [name for name, _ in parts]


def _depth(content: Any, key: Sequence[int | str]) -> int:
    """Return the number of leading parts of a key that exist in the content."""
    for number, part in enumerate(key):
        try:
            content = content[part]
        except (KeyError, IndexError, TypeError):
            return number
    return len(key)
