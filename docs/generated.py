"""Text of the manual that is generated from the code: commands, configuration keys, modules of a package.

A line such as `<!-- generated: commands -->` in a page is replaced by Markdown.
"""

from __future__ import annotations

import inspect
import io
import json
import pkgutil
import re
import tokenize
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from typer.models import ArgumentInfo, OptionInfo

_MARK = re.compile(r"^<!-- generated: (\w+)(?: ([\w.]+))? -->$", re.MULTILINE)
_CODE = re.compile(r"(``?[^`]+``?)")
_ENGINE = re.compile(r"embree|taichi|numba|kernels|device")  # fast implementations of other modules
_BOUNDS = (("exclusiveMinimum", "> "), ("minimum", "≥ "), ("exclusiveMaximum", "< "), ("maximum", "≤ "))

Schema = dict[str, Any]


def fill_page(_app: object, _docname: str, source: list[str]) -> None:
    """Replace the marks in a page by generated text."""
    texts = {"commands": commands, "configuration": configuration, "modules": modules}
    source[0] = _MARK.sub(lambda mark: texts[mark[1]](*([mark[2]] if mark[2] else [])), source[0])


def commands() -> str:
    """Return all commands of `polarsim` with arguments and options, from the signatures that typer reads."""
    from polarsim.cli import app

    callbacks = [command.callback for command in app.registered_commands if command.callback]
    return "\n\n".join(_command(callback) for callback in sorted(callbacks, key=lambda callback: callback.__name__))


def _command(callback: Callable[..., Any]) -> str:
    command = callback.__name__.rstrip("_")  # keywords of Python have a trailing underscore
    hints, rows, usage = get_type_hints(callback, include_extras=True), [], f"polarsim {command} [OPTIONS]"
    for name, parameter in inspect.signature(callback).parameters.items():
        if get_origin(hints[name]) is not Annotated:
            continue  # typer's context
        kind, info = get_args(hints[name])
        shown = _metavar(name, info, parameter) if isinstance(info, ArgumentInfo) else _option(name, info, kind)
        usage += f" {shown}" if isinstance(info, ArgumentInfo) else ""
        rows.append(_row(f"`{shown}`", _default_of(parameter), _escaped(info.help or "")))
    parts = [
        f"## `polarsim {command}`",
        _escaped(inspect.getdoc(callback) or ""),
        f"```text\n{usage}\n```",
        "| argument or option | default | meaning |\n|---|---|---|\n" + "\n".join(rows) if rows else "",
    ]
    return "\n\n".join(filter(None, parts))


def _metavar(name: str, info: ArgumentInfo, parameter: inspect.Parameter) -> str:
    shown = info.metavar or name.upper()
    return shown if parameter.default is inspect.Parameter.empty else f"[{shown}]"


def _option(name: str, info: OptionInfo, kind: Any) -> str:
    """Return the name of an option and the kind of value."""
    declared = (info.default, *(info.param_decls or ()))
    given = [text for text in declared if isinstance(text, str) and text.startswith("-")]
    written = given or [f"--{name.replace('_', '-')}"]
    inner = kind  # type of the items of a list, or of an optional value
    if get_origin(kind) is not Literal:
        inner = next((part for part in get_args(kind) if part is not type(None)), kind)
    if kind is bool:
        return written[0] if given else f"{written[0]} / --no-{name.replace('_', '-')}"
    if get_origin(kind) is tuple or get_origin(inner) is tuple:
        many = kind if get_origin(kind) is tuple else inner
        return f"{written[0]} {' '.join(part.__name__.upper() for part in get_args(many))}"
    values = "/".join(get_args(inner)) if get_origin(inner) is Literal else inner.__name__.upper()
    return f"{written[0]} {info.metavar or values}"


def _default_of(parameter: inspect.Parameter) -> str:
    default = parameter.default
    missing = any(default is value for value in (None, False, inspect.Parameter.empty)) or default == ""
    return "" if missing else f"`{default}`"


def configuration(of: str = "run") -> str:
    """Return all keys of the configuration of a `run` or of a file of `views`, from the model that checks them."""
    from polarsim.config import Config
    from polarsim.render.views.options import Views

    schema = (Views if of == "views" else Config).model_json_schema()
    pages = _Keys(schema.get("$defs", {}))
    parts = list(pages.section(schema, ""))
    shown: set[str] = set()
    while remaining := sorted(pages.linked - shown):
        for name in remaining:
            shown.add(name)
            parts += pages.section(schema["$defs"][name], name)
    return "\n\n".join(parts)


class _Keys:
    """Tables of the keys of a JSON schema; a key with a fixed set of keys below it is a section."""

    def __init__(self, definitions: dict[str, Schema]) -> None:
        self.definitions = definitions
        self.linked: set[str] = set()  # models in lists and unions, shown after the sections

    def section(self, schema: Schema, path: str) -> Iterator[str]:
        inner, rows = [], []
        for name, key in schema.get("properties", {}).items():
            if "$ref" in key and "properties" in self._definition(key):
                inner.append((name, key))
                continue
            default = "required" if name in schema.get("required", ()) else _default(key)
            rows.append(_row(f"`{name}`", self._kind(key), default, _escaped(key.get("description", ""))))
        if path:
            yield f"{'#' * min(path.count('.') + 2, 4)} `{path}`"
            yield _escaped(schema.get("description", ""))
        if rows:
            yield "| key | value | default | meaning |\n|---|---|---|---|\n" + "\n".join(rows)
        for name, key in inner:
            description = {"description": key["description"]} if "description" in key else {}
            yield from self.section(self._definition(key) | description, f"{path}.{name}".lstrip("."))

    def _definition(self, key: Schema) -> Schema:
        return self.definitions[key["$ref"].rsplit("/", 1)[1]]

    def _kind(self, key: Schema) -> str:
        """Describe the valid values of a key."""
        for several in ("anyOf", "oneOf"):
            if several in key:
                return " or ".join(dict.fromkeys(self._kind(part) for part in key[several]))
        if "$ref" in key:
            name = key["$ref"].rsplit("/", 1)[1]
            if "properties" not in self.definitions[name]:
                return self._kind(self.definitions[name])
            self.linked.add(name)
            return f"[{name}](#{name.lower()})"
        if "const" in key or "enum" in key:
            return ", ".join(f"`{value}`" for value in key.get("enum", [key.get("const")]))
        if key.get("type") == "array":
            if "prefixItems" in key:
                return "list: " + ", ".join(self._kind(item) for item in key["prefixItems"])
            return f"list of {self._kind(key.get('items', {}))}"
        if key.get("type") == "object":
            values = key.get("additionalProperties")
            return f"name: {self._kind(values)}" if isinstance(values, dict) else "keys and values"
        bounds = [f"{sign}{key[bound]}" for bound, sign in _BOUNDS if bound in key]
        words = {"null": "`null`", "string": key.get("format", "text"), "boolean": "`true`, `false`"}
        return " ".join([words.get(key.get("type", ""), key.get("type", "anything")), ", ".join(bounds)]).strip()


def _default(key: Schema) -> str:
    if "default" not in key:
        return ""
    return "" if key["default"] is None else f"`{json.dumps(key['default'], ensure_ascii=False)}`"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def _escaped(text: str) -> str:
    """Escape plain text for Markdown, except code in backticks."""
    parts = _CODE.split(text)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<>\[\]#|])", r"\\\1", part) for part in parts)


def modules(package: str) -> str:
    """Return the public names of all modules of a package, from signatures and docstrings."""
    parent = import_module(package)
    infos = pkgutil.walk_packages(parent.__path__, f"{package}.")
    names = sorted(info.name for info in infos if not _ENGINE.search(info.name))
    return "\n\n".join(
        f"## `{name.removeprefix('polarsim.')}`\n\n```{{eval-rst}}\n.. automodule:: {name}\n```" for name in names
    )


def plain_docstring(_app: object, what: str, name: str, _found: object, _options: object, lines: list[str]) -> None:
    """Escape markup in docstrings, which are plain text, except code in backticks.

    An attribute without docstring is described by the comment in the same line, which states units and shapes.
    """
    if what == "attribute" and not any(lines):
        lines[:] = [comment_of(*name.rsplit(".", 2)), ""]
    for number, line in enumerate(lines):
        parts = _CODE.split(line)
        lines[number] = "".join(
            part if part.startswith("`") else re.sub(r"([*|])|(?<=\w)(_)(?!\w)", r"\\\1\2", part) for part in parts
        )


def comment_of(module: str, cls: str, attribute: str) -> str:
    """Return the comment in the line of an attribute, or an empty string."""
    return _comments(module).get((cls, attribute), "")


@cache
def _comments(module: str) -> dict[tuple[str, str], str]:
    """Return the comments of annotated names in the classes of a module, by class and name."""
    comments, cls, name = {}, "", ""
    try:
        source = inspect.getsource(import_module(module))
    except ImportError:  # a nested class
        return {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME and (start := re.match(r"class (\w+)", token.line)):
            cls = start[1]
        elif token.type == tokenize.NAME and (start := re.match(r" {4}(\w+): ", token.line)):
            name = start[1]
        elif token.type == tokenize.COMMENT and name and token.line.startswith(f"    {name}: "):
            comments[cls, name] = token.string.lstrip("# ")
    return comments


def without_inherited(_app: object, _what: str, name: str, _found: object, skip: bool, _options: object) -> bool | None:
    """Skip the members that pydantic adds to every class of options."""
    return True if name.startswith("model_") else (skip or None)
