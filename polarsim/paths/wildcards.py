"""Types and resources of jobs that depend on wildcards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Options = dict[str, Any]  # values for `params` of a rule, as of JSON


class Wildcards(Protocol):
    """Values of the wildcards of a job."""

    def __getattr__(self, name: str) -> str:
        """Return the value of a wildcard."""
        ...


def memory_per_attempt(mem_mb: int) -> Callable[[Wildcards, int], int]:
    """Return the memory of a job, MB: doubled at each further attempt (`--retries`)."""

    def of_attempt(wildcards: Wildcards, attempt: int) -> int:  # noqa: ARG001
        return int(mem_mb * 2 ** (attempt - 1))

    return of_attempt
