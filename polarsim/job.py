"""A job of the workflow: a function of polarsim, called with the files, params and wildcards of its rule."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from inspect import signature
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter

from polarsim.reporting import reporting


@contextmanager
def job(snakemake: Any) -> Iterator[Callable[..., Any]]:
    """Log to the file of a job, and hand out `call`, which calls functions with what the job's rule names.

    `call(function, **given)` returns what the function returns. An argument that is not given is the output, input or
    param of its name, else the wildcard of its name or the job's `threads`, else it keeps its default. Pydantic makes
    each value what its annotation says: a path, a number, a list of paths, options. Where an argument may be None, an
    input without files is None; where it takes no list, a list of one file is that file.

    Raises
    ------
    TypeError
        Two of outputs, inputs and params have the name of an argument, so that it must be given; or the function has
        no argument of a name that is given.
    """
    with reporting(log=snakemake.log[0]):
        yield partial(_call, snakemake)


def _call(snakemake: Any, function: Callable[..., Any], **given: Any) -> Any:
    rule = [dict(part.items()) for part in (snakemake.output, snakemake.input, snakemake.params)]
    rest = {**dict(snakemake.wildcards.items()), "threads": snakemake.threads}
    arguments = dict(given)
    for name in signature(function).parameters.keys() - given.keys():
        found = [part[name] for part in rule if name in part]
        if len(found) > 1:
            raise TypeError(f"{snakemake.rule}: {name} stands for {len(found)} files or params, so it must be given")
        if found or name in rest:
            arguments[name] = found[0] if found else rest[name]
    annotations = get_type_hints(function)
    return function(**{name: _converted(value, annotations.get(name, Any)) for name, value in arguments.items()})


def _converted(value: Any, annotation: Any) -> Any:
    if isinstance(value, list):
        value = list(value)  # Snakemake's lists of files are of a class of their own
        if not value and type(None) in get_args(annotation):
            return None
        if len(value) == 1 and not _takes_several(annotation):  # a rule that expands to one file says so as a list
            (value,) = value
    return TypeAdapter(annotation).validate_python(value)


def _takes_several(annotation: Any) -> bool:
    """Whether an argument may be a list: by its type, or by one of those that it may have."""
    kinds = [get_origin(kind) or kind for kind in (annotation, *get_args(annotation))]
    sequences = (
        isinstance(kind, type) and issubclass(kind, Collection | Iterator) for kind in kinds if kind is not str
    )
    return Any in kinds or any(sequences)
