"""Targets and words for Snakemake, checked before Snakemake starts."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from polarsim.errors import PolarsimError

_RULE = re.compile(r"^(?:    )?rule (\w+):\n((?:(?:    )?    .*\n|\n)*)", re.MULTILINE)
_OWN = {  # options of Snakemake that `polarsim run` has itself, under one name
    "configfile": "--configfile FILE, repeated for each file",
    "config": "--config KEY=VALUE, repeated for each key",
}


class CallError(PolarsimError):
    """A call of `polarsim run` that is a usage error."""


def targets_of(targets: Sequence[str], rest: Sequence[str]) -> list[str]:
    """Return all targets of a call.

    Parameters
    ----------
    targets
        Words in front of the first option of Snakemake.
    rest
        That option and all further words: options, their values, targets.

    Raises
    ------
    CallError
        Snakemake does not take the words, or a word is a key or a file of the configuration.
    """
    found = list(targets)
    if rest:
        parsed = _parsed(rest)
        for name, own in _OWN.items():
            if getattr(parsed, name, None):
                raise CallError(f"expected {own}")
        found += parsed.targets
    for word in found:
        if "=" in word and "/" not in word.partition("=")[0]:
            raise CallError(f"{word!r} is no target: expected --config {word}")
        if word.endswith((".yaml", ".yml")) and not word.startswith("results/"):
            raise CallError(f"{word!r} is a configuration file, no target: expected --configfile {word} for each file")
    return found


def refuse_unknown(folder: Path, run: str, targets: Sequence[str], configured: Sequence[str]) -> None:
    """End where no rule makes a target.

    Parameters
    ----------
    folder
        Folder with the Snakefile.
    run
        Name of the run.
    targets
        Names of rules, and files.
    configured
        Words of Snakemake that name the configuration.

    Raises
    ------
    CallError
        A target is no stage, a file of another run, or a file that no rule makes.
    """
    names = [word for word in targets if "/" not in word and "." not in word]
    stages, known = _rules(folder)
    for name in names:
        if name not in known:
            near = get_close_matches(name, sorted(known), n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise CallError(f"{name!r} is no target; {hint}Stages: {', '.join(stages)}")
    for file in targets:
        parts = Path(file).parts
        if file in names or (folder / file).exists():
            continue
        if parts[:1] == ("results",) and len(parts) > 2 and parts[1] != run:
            raise CallError(
                f"{file} is of run {parts[1]!r}, the configuration of run {run!r}: name that of {parts[1]!r} with "
                f"--configfile, or add --config run={parts[1]}"
            )
        if not _is_made(file, configured):
            raise CallError(f"{file}: no rule makes it with this configuration; docs/formats.md lists a run's files")


def _parsed(words: Sequence[str]) -> argparse.Namespace:
    """Parse words as Snakemake does; options that its parser does not have are left to its plugins."""
    from snakemake.cli import get_argument_parser

    def refuse(message: str) -> None:
        raise CallError(f"snakemake: {message}")

    parser = get_argument_parser()
    parser.error = refuse
    namespace: argparse.Namespace = parser.parse_known_args(list(words))[0]
    return namespace


def _rules(folder: Path) -> tuple[list[str], set[str]]:
    """Return the names of the rules without outputs, which are the stages, and of all rules."""
    files = [folder / "Snakefile", folder / "workflow/Snakefile", *(folder / "workflow/rules").glob("*.smk")]
    found = [match for file in files if file.exists() for match in _RULE.findall(file.read_text(encoding="utf-8"))]
    stages = [name for name, body in found if not re.search(r"^\s+output:", body, re.MULTILINE)]
    return sorted(stages), {name for name, _ in found}


def _is_made(file: str, call: Sequence[str]) -> bool:
    """Return whether a rule makes a file; other errors are reported by the run."""
    words = [sys.executable, "-m", "snakemake", file, "--summary", *call]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.returncode == 0 or "MissingRuleException" not in done.stdout + done.stderr
