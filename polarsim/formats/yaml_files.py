"""YAML files that hold a pydantic model, and what is wrong with them in one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from polarsim.errors import ConfigError
from polarsim.formats.files import packaged, text_of
from polarsim.formats.readers import reader

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml's takes a tenth of the time
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")  # YAML 1.1 reads 010 as octal 8, and 08 as text
_SEXAGESIMAL = re.compile(r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?")  # YAML 1.1 reads 1:30 as 90
Model = TypeVar("Model", bound=BaseModel)


@reader("YAML file", largest_mb=1, error=ConfigError)
def read_yaml(path: str | Path) -> Any:
    """What a YAML file holds; one of `config/` may be that which came with polarsim (see `files.packaged`).

    Raises
    ------
    ConfigError
        No file, or no YAML.
    """
    return parse_yaml(text_of(packaged(path)))


def parse_yaml(text: str) -> Any:
    """Parse a YAML text.

    Stricter than YAML 1.1 where its rules silently change what a person wrote.

    Raises
    ------
    yaml.YAMLError
        No YAML.
    ConfigError
        A key given twice in one mapping; a number with leading zeros or with colons; a value that contains itself.
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
    """Refuse repeated keys, ambiguous numbers and values that contain themselves, in a node and all nodes below it."""
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
                    reason = f"the key {key.value!r} is given twice, first in line {first_line[name]}: merge the two"
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
        raise ConfigError(f"{node.value} is a number to the base 60 in YAML: write '{node.value}' for text", line=line)


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
    """Describe all problems in one line; those of no single key are the `whole`'s."""
    problems: dict[tuple[str, ...], list[Any]] = {}
    for problem in error.errors():
        problems.setdefault(_key(problem["loc"]), []).append(problem)
    # Where a part is wrong, pydantic also complains of the list that lacks it, or of a form that the whole could have.
    outer = {key[:length] for key in problems for length in range(len(key))}
    return "; ".join(f"{'.'.join(key) or whole}{_reason(found)}" for key, found in problems.items() if key not in outer)


def _key(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Return a key as a file has it: without the types that pydantic tried."""
    tried = {"int", "float", "str", "bool", *_names_below(BaseModel)}
    return tuple(str(part) for part in location if part not in tried and "[" not in str(part))


def _names_below(kind: type) -> set[str]:
    subclasses: list[type] = kind.__subclasses__()
    return {name for below in subclasses for name in (below.__name__, *_names_below(below))}


def _reason(problems: list[Any]) -> str:
    """Return what is wrong with one key: each problem is a form that its value could have and has not."""
    problem = problems[0]
    known = {"extra_forbidden": ": unknown key", "missing": ": missing", "union_tag_not_found": ".kind: missing"}
    if problem["type"] in known:
        return known[problem["type"]]
    found = problem.get("input")
    text = problem["msg"].removeprefix("Value error, ")
    ours = problem["type"] == "value_error"  # such a text may say already what was found
    if not ours:
        first, *others = dict.fromkeys(map(_expected, problems))
        text = " or ".join([first, *(other.removeprefix("should be ") for other in others)])
    if isinstance(found, BaseModel | dict) or (ours and str(found) in text):
        return f": {text}"
    return f": {text}, found {found!r}"


def _expected(problem: Any) -> str:
    """Return what a value should be, in the words of a configuration file."""
    kind, context = problem["type"], problem.get("ctx", {})
    form = next((form for start, form in _FORMS.items() if kind.startswith(start)), None)
    if form:
        return f"should be {form}"
    if kind in ("too_short", "too_long"):
        least, length = kind == "too_short", context["min_length" if kind == "too_short" else "max_length"]
        return f"should have at {'least' if least else 'most'} {length} {'entry' if length == 1 else 'entries'}"
    if kind == "string_pattern_mismatch":
        return f"should match {context['pattern']}"
    return str(problem["msg"]).removeprefix("Input ")


_FORMS = {  # beginning of pydantic's name of a problem -> what was expected
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
