"""What pages of the manual read off the code: commands, configuration keys, and the modules of a package.

A page asks for it by a line of its own, such as `<!-- generated: commands -->`; the text that stands there in the site
is Markdown.
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
_ENGINE = re.compile(r"embree|taichi|numba|kernels|float_mode|device")  # the fast ways of what another module defines
_BOUNDS = (("exclusiveMinimum", "> "), ("minimum", "≥ "), ("exclusiveMaximum", "< "), ("maximum", "≤ "))

Schema = dict[str, Any]


def fill_page(_app: object, _docname: str, source: list[str]) -> None:
    """Put generated text in the place of the lines that ask for it."""
    texts = {"commands": commands, "configuration": configuration, "modules": modules}
    source[0] = _MARK.sub(lambda found: texts[found[1]](*([found[2]] if found[2] else [])), source[0])


def commands() -> str:
    """Every command of `polarsim` with its arguments and options, off the signatures that typer reads."""
    from polarsim.cli import app

    callbacks = [one.callback for one in app.registered_commands if one.callback]
    return "\n\n".join(_command(callback) for callback in sorted(callbacks, key=lambda one: one.__name__))


def _command(callback: Callable[..., Any]) -> str:
    own = callback.__name__.rstrip("_")  # one that is a word of Python's has a dash below behind it
    hints, rows, usage = get_type_hints(callback, include_extras=True), [], f"polarsim {own} [OPTIONS]"
    for name, parameter in inspect.signature(callback).parameters.items():
        if get_origin(hints[name]) is not Annotated:
            continue  # typer's own context
        kind, info = get_args(hints[name])
        shown = _metavar(name, info, parameter) if isinstance(info, ArgumentInfo) else _option(name, info, kind)
        usage += f" {shown}" if isinstance(info, ArgumentInfo) else ""
        rows.append(_row(f"`{shown}`", _default_of(parameter), _escaped(info.help or "")))
    parts = [
        f"## `polarsim {own}`",
        _escaped(inspect.getdoc(callback) or ""),
        f"```text\n{usage}\n```",
        "| argument or option | default | meaning |\n|---|---|---|\n" + "\n".join(rows) if rows else "",
    ]
    return "\n\n".join(filter(None, parts))


def _metavar(name: str, info: ArgumentInfo, parameter: inspect.Parameter) -> str:
    shown = info.metavar or name.upper()
    return shown if parameter.default is inspect.Parameter.empty else f"[{shown}]"


def _option(name: str, info: OptionInfo, kind: Any) -> str:
    """An option as it is written, with what its value is."""
    given = [one for one in (info.default, *(info.param_decls or ())) if isinstance(one, str) and one.startswith("-")]
    written = given or [f"--{name.replace('_', '-')}"]
    inner = kind  # or what a list holds, or what may be absent
    if get_origin(kind) is not Literal:
        inner = next((one for one in get_args(kind) if one is not type(None)), kind)
    if kind is bool:
        return written[0] if given else f"{written[0]} / --no-{name.replace('_', '-')}"
    if get_origin(kind) is tuple or get_origin(inner) is tuple:
        many = kind if get_origin(kind) is tuple else inner
        return f"{written[0]} {' '.join(one.__name__.upper() for one in get_args(many))}"
    values = "/".join(get_args(inner)) if get_origin(inner) is Literal else inner.__name__.upper()
    return f"{written[0]} {info.metavar or values}"


def _default_of(parameter: inspect.Parameter) -> str:
    default = parameter.default
    nothing = any(default is one for one in (None, False, inspect.Parameter.empty)) or default == ""
    return "" if nothing else f"`{default}`"


def configuration(of: str = "run") -> str:
    """Every key of a `run`'s configuration or of a file of `views`, off the model that checks it."""
    from polarsim.config import Config
    from polarsim.render.views.options import Views

    whole = (Views if of == "views" else Config).model_json_schema()
    pages = _Keys(whole.get("$defs", {}))
    parts = list(pages.section(whole, ""))
    shown: set[str] = set()
    while left := sorted(pages.linked - shown):
        for name in left:
            shown.add(name)
            parts += pages.section(whole["$defs"][name], name)
    return "\n\n".join(parts)


class _Keys:
    """Tables of keys out of a JSON schema; keys that hold one set of keys are sections of their own."""

    def __init__(self, definitions: dict[str, Schema]) -> None:
        self.definitions = definitions
        self.linked: set[str] = set()  # sets of keys that a list or a choice holds: shown after the sections

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
            told = {"description": key["description"]} if "description" in key else {}
            yield from self.section(self._definition(key) | told, f"{path}.{name}".lstrip("."))

    def _definition(self, key: Schema) -> Schema:
        return self.definitions[key["$ref"].rsplit("/", 1)[1]]

    def _kind(self, key: Schema) -> str:
        """What a value may be, in words."""
        for several in ("anyOf", "oneOf"):
            if several in key:
                return " or ".join(dict.fromkeys(self._kind(one) for one in key[several]))
        if "$ref" in key:
            name = key["$ref"].rsplit("/", 1)[1]
            if "properties" not in self.definitions[name]:
                return self._kind(self.definitions[name])
            self.linked.add(name)
            return f"[{name}](#{name.lower()})"
        if "const" in key or "enum" in key:
            return ", ".join(f"`{one}`" for one in key.get("enum", [key.get("const")]))
        if key.get("type") == "array":
            if "prefixItems" in key:
                return "list: " + ", ".join(self._kind(one) for one in key["prefixItems"])
            return f"list of {self._kind(key.get('items', {}))}"
        if key.get("type") == "object":
            values = key.get("additionalProperties")
            return f"name: {self._kind(values)}" if isinstance(values, dict) else "keys and values"
        bounds = [f"{sign}{key[bound]}" for bound, sign in _BOUNDS if bound in key]
        words = {"null": "nothing", "string": key.get("format", "text"), "boolean": "`true`, `false`"}
        return " ".join([words.get(key.get("type", ""), key.get("type", "anything")), ", ".join(bounds)]).strip()


def _default(key: Schema) -> str:
    if "default" not in key:
        return ""
    return "" if key["default"] is None else f"`{json.dumps(key['default'], ensure_ascii=False)}`"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def _escaped(text: str) -> str:
    """Plain text as Markdown: nothing but what stands in backticks is markup."""
    parts = _CODE.split(text)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<>\[\]#|])", r"\\\1", part) for part in parts)


def modules(package: str) -> str:
    """The public names of every module of a package, off their signatures and docstrings."""
    parent = import_module(package)
    found = pkgutil.walk_packages(parent.__path__, f"{package}.")
    names = sorted(one.name for one in found if not _ENGINE.search(one.name))
    return "\n\n".join(
        f"## `{name.removeprefix('polarsim.')}`\n\n```{{eval-rst}}\n.. automodule:: {name}\n```" for name in names
    )


def plain_docstring(_app: object, what: str, name: str, _found: object, _options: object, lines: list[str]) -> None:
    """Docstrings are plain text: take the meaning of markup out of all that stands outside backticks.

    An attribute without a docstring is told by the comment that stands behind it, where units and shapes are.
    """
    if what == "attribute" and not any(lines):
        lines[:] = [comment_of(*name.rsplit(".", 2)), ""]
    for number, line in enumerate(lines):
        parts = _CODE.split(line)
        lines[number] = "".join(
            part if part.startswith("`") else re.sub(r"([*|])|(?<=\w)(_)(?!\w)", r"\\\1\2", part) for part in parts
        )


def comment_of(module: str, cls: str, attribute: str) -> str:
    """The comment behind an attribute in its class's body; empty where there is none."""
    return _comments(module).get((cls, attribute), "")


@cache
def _comments(module: str) -> dict[tuple[str, str], str]:
    """Comments behind annotated names of a module's classes, by class and name."""
    found, cls, name = {}, "", ""
    try:
        source = inspect.getsource(import_module(module))
    except ImportError:  # a class within a class
        return {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME and (start := re.match(r"class (\w+)", token.line)):
            cls = start[1]
        elif token.type == tokenize.NAME and (start := re.match(r" {4}(\w+): ", token.line)):
            name = start[1]
        elif token.type == tokenize.COMMENT and name and token.line.startswith(f"    {name}: "):
            found[cls, name] = token.string.lstrip("# ")
    return found


def without_inherited(_app: object, _what: str, name: str, _found: object, skip: bool, _options: object) -> bool | None:
    """Leave out what pydantic puts into every class of options."""
    return True if name.startswith("model_") else (skip or None)
