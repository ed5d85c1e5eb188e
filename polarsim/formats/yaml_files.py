"""YAML files of pydantic models, with all errors of a file reported in a single line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from polarsim.errors import ConfigError
from polarsim.formats.files import resolve_packaged, text_of
from polarsim.formats.readers import reader

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the loader of libyaml is ten times as fast
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")  # YAML 1.1 reads 010 as octal 8, and 08 as text
_SEXAGESIMAL = re.compile(r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?")  # YAML 1.1 reads 1:30 as 90
Model = TypeVar("Model", bound=BaseModel)


@reader("YAML file", largest_mb=1, error=ConfigError)
def read_yaml(path: str | Path) -> Any:
    """Read a YAML file; a missing file of `config/` is read from the installed package."""
    return parse_yaml(text_of(resolve_packaged(path)))


def parse_yaml(text: str) -> Any:
    """Parse a YAML text.

    Values that YAML 1.1 would silently interpret in an unexpected way are errors.
    """
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _check_nodes(node, set(), frozenset())
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _check_nodes(node: yaml.Node, checked: set[int], above: frozenset[int]) -> None:
    """Raise an error for repeated keys, ambiguous numbers and recursive values in a node and all descendants."""
    if id(node) in above:
        raise ConfigError("this value contains itself through an alias", line=node.start_mark.line + 1)
    if id(node) in checked:  # an alias
        return
    checked.add(id(node))
    above |= {id(node)}
    if isinstance(node, yaml.ScalarNode):
        _check_number(node)
    elif isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _check_nodes(item, checked, above)
    elif isinstance(node, yaml.MappingNode):
        first_line: dict[tuple[str, str], int] = {}
        for key, value in node.value:
            _check_nodes(key, checked, above)
            if isinstance(key, yaml.ScalarNode):
                name, line = (key.tag, key.value), key.start_mark.line + 1
                if name in first_line and not key.tag.endswith(":merge"):
                    reason = f"the key {key.value!r} is repeated, first in line {first_line[name]}: merge both"
                    raise ConfigError(reason, line=line)
                first_line[name] = line
            _check_nodes(value, checked, above)


def _check_number(node: yaml.ScalarNode) -> None:
    if node.style:  # quoted: text
        return
    line = node.start_mark.line + 1
    if _LEADING_ZERO.fullmatch(node.value):
        plain = node.value.replace("_", "").lstrip("+-0") or "0"
        raise ConfigError(f"{node.value} has a leading zero: write {plain}, or '{node.value}' for text", line=line)
    if _SEXAGESIMAL.fullmatch(node.value) and not node.tag.endswith((":str", ":timestamp")):
        raise ConfigError(f"{node.value} is a base-60 number in YAML: write '{node.value}' for text", line=line)


@reader("YAML file", largest_mb=1, error=ConfigError)
def read_model(path: str | Path, model: type[Model], subject: str) -> Model:
    """Read a model from a YAML file; `subject` is the name of the model in messages about no particular key."""
    content = read_yaml(path)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(describe_error(error, subject), path=path) from error


def describe_error(error: ValidationError, subject: str) -> str:
    """Describe all errors in a single line; errors of no particular key are attributed to `subject`."""
    problems: dict[tuple[str, ...], list[Any]] = {}
    for problem in error.errors():
        problems.setdefault(_key(problem["loc"]), []).append(problem)
    # If a part is invalid, pydantic also reports the enclosing list, or another member of a union.
    outer = {key[:length] for key in problems for length in range(len(key))}
    return "; ".join(
        f"{'.'.join(key) or subject}{_reason(of_key)}" for key, of_key in problems.items() if key not in outer
    )


def _key(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Return a key as written in the file, without the types that pydantic tried."""
    tried = {"int", "constrained-int", "float", "str", "bool", *_names_below(BaseModel)}
    return tuple(str(part) for part in location if part not in tried and "[" not in str(part))


def _names_below(kind: type) -> set[str]:
    subclasses: list[type] = kind.__subclasses__()
    return {name for below in subclasses for name in (below.__name__, *_names_below(below))}


def _reason(problems: list[Any]) -> str:
    """Return the reason why the value of a key is invalid; each problem belongs to a form that the value could have."""
    problem = problems[0]
    known = {"extra_forbidden": ": unknown key", "missing": ": missing", "union_tag_not_found": ".kind: missing"}
    if problem["type"] in known:
        return known[problem["type"]]
    value = problem.get("input")
    text = problem["msg"].removeprefix("Value error, ")
    by_validator = problem["type"] == "value_error"  # the text of a validator may already quote the value
    if not by_validator:
        first, *rest = dict.fromkeys(map(_expected, problems))
        text = " or ".join([first, *(form.removeprefix("should be ") for form in rest)])
    if isinstance(value, BaseModel | dict) or (by_validator and str(value) in text):
        return f": {text}"
    return f": {text}, found {value!r}"


def _expected(problem: Any) -> str:
    """Return the expected form of a value in terms of a configuration file."""
    kind, context = problem["type"], problem.get("ctx", {})
    form = next((form for start, form in _FORMS.items() if kind.startswith(start)), None)
    if form:
        return f"should be {form}"
    if kind in ("too_short", "too_long"):
        bound, length = ("least", context["min_length"]) if kind == "too_short" else ("most", context["max_length"])
        return f"should have at {bound} {length} {'entry' if length == 1 else 'entries'}"
    if kind == "string_pattern_mismatch":
        return f"should match {context['pattern']}"
    return str(problem["msg"]).removeprefix("Input ")


_FORMS = {  # start of pydantic's error type -> expected form
    "int_": "a whole number",
    "float_": "a number",
    "bool_": "true or false",
    "string_type": "text (quote it)",
    "path_type": "a path",
    "tuple_type": "a list",
    "list_type": "a list",
    "set_type": "a list",
    "dict_type": "a section of keys",
    "model_type": "a section of keys",
    "model_attributes_type": "a section of keys",
}
