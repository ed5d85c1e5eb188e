"""Checks of targets and options of Snakemake before Snakemake starts."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from polarsim.errors import ConfigError, PolarsimError

_RULE = re.compile(r"^((?:    )?)rule (\w+):\n((?:\1    .*\n|\n)*)", re.MULTILINE)  # indentation, name, body
_USED = re.compile(r"^ *use rule (\w+) as (\w+) with:", re.MULTILINE)
_INCLUDED = re.compile(r'^include: "rules/(\w+\.smk)"', re.MULTILINE)
_NO_RULE = re.compile(r"MissingRuleException:\s+No rule to produce (\S+)")
_OUTPUT = re.compile(r"^( +)output:(.*?)(?=^\1\w+:|\Z)", re.MULTILINE | re.DOTALL)
_OF_RUN = ("--configfile", "--config", "--cores", "--min-free", "--verbose")
_OWN = {  # options of Snakemake that are also options of `polarsim run`
    "configfile": "--configfile FILE, repeated for each file",
    "config": "--config KEY=VALUE, repeated for each key",
}


class CallError(PolarsimError):
    """Usage error of `polarsim run`."""


def targets_of(targets: Sequence[str], rest: Sequence[str]) -> list[str]:
    """Return all targets of a call: words before the first option of Snakemake, and targets among the `rest`."""
    found = list(targets)
    if rest:
        parsed = _parsed(rest)
        for name, own in _OWN.items():
            if getattr(parsed, name, None):
                raise CallError(f"expected {own}")
        found += parsed.targets
    for word in found:
        if "=" in word and "/" not in word.partition("=")[0]:
            raise CallError(f"{word!r} is not a target: expected --config {word}")
        if word.endswith((".yaml", ".yml")) and not word.startswith("results/"):
            raise CallError(f"{word!r} is a configuration file: expected --configfile {word} for each file")
    return found


def refuse_unknown(folder: Path, run: str, targets: Sequence[str], configured: Sequence[str]) -> None:
    """Raise `CallError` if no rule of the workflow in a folder creates a target, `ConfigError` if a rule lacks inputs.

    Targets are names of rules and files; `configured` are the options of Snakemake that define the configuration.
    """
    names = [word for word in targets if "/" not in word and "." not in word]
    stages, known, of_files = _rules(folder)
    for name in names:
        if name not in known:
            near = get_close_matches(name, sorted(known), n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise CallError(f"{name!r} is not a target; {hint}Stages: {', '.join(stages)}")
        if name in of_files:
            raise CallError(
                f"rule {name} makes files of several runs or terrains; request one of its files, listed in "
                f"docs/formats.md, or a stage: {', '.join(stages)}"
            )
    files = [file for file in targets if file not in names and not (folder / file).exists()]
    for file in files:
        parts = Path(file).parts
        if parts[:1] == ("results",) and len(parts) > 2 and parts[1] != run:
            raise CallError(
                f"{file} belongs to run {parts[1]!r}, the configuration to run {run!r}: add --configfile with the "
                f"configuration of {parts[1]!r}, or --config run={parts[1]}"
            )
    if files and (missing := _without_rule(files, configured)):
        begin = "" if Path(missing).parts[:1] == ("results",) else f", which begin with results/{run}/"
        raise CallError(
            f"{missing}: not an output of a rule with this configuration; docs/formats.md lists the files of a "
            f"run{begin}"
        )


def _parsed(words: Sequence[str]) -> argparse.Namespace:
    """Parse words like Snakemake, with options of its plugins; unknown options and invalid values are usage errors."""
    from snakemake.cli import get_argument_parser

    def refuse(message: str) -> None:
        raise CallError(f"snakemake: {message}")

    parser = get_argument_parser()
    parser.error = refuse
    namespace, unknown = parser.parse_known_args(list(words))
    if unknown:
        options = [option.partition("=")[0] for option in unknown if option.startswith("-")]
        wrong = (options or unknown)[0]
        known = [option for action in parser._actions for option in action.option_strings] + list(_OF_RUN)
        near = get_close_matches(wrong, known, n=1)
        raise CallError(
            f"no option {wrong} of polarsim run or Snakemake{f'; did you mean {near[0]}?' if near else ''}"
            if options
            else f"{wrong!r}: targets must be in one place, before the options"
        )
    parsed: argparse.Namespace = namespace
    return parsed


def _rules(folder: Path) -> tuple[list[str], set[str], set[str]]:
    """Return the names of the stages (rules without outputs), of all rules, and of rules with wildcards."""
    found = [match for _, text in _rule_files(folder) for match in _RULE.findall(text)]
    stages = [name for _, name, body in found if not _has_output(body)]
    return sorted(stages), {name for _, name, _ in found}, {name for _, name, body in found if _has_wildcards(body)}


def stages_of_rules(folder: Path) -> dict[str, str]:
    """Return the stage (name of the rule file) of each rule with outputs, in the order of the workflow."""
    found: dict[str, str] = {}
    for stage, text in _rule_files(folder):
        names = [name for _, name, body in _RULE.findall(text) if _has_output(body)]
        found |= dict.fromkeys([*names, *(name for _, name in _USED.findall(text))], stage)
    return found


def _rule_files(folder: Path) -> list[tuple[str, str]]:
    """Return name and text of the rule files of a workflow, in the order of the workflow."""
    mains = [path for path in (folder / "Snakefile", folder / "workflow/Snakefile") if path.exists()]
    included = [name for path in mains for name in _INCLUDED.findall(path.read_text(encoding="utf-8"))]
    files = [*mains, *(folder / "workflow/rules" / name for name in included)]
    return [("jobs" if path in mains else path.stem, path.read_text(encoding="utf-8")) for path in files]


def _has_output(body: str) -> bool:
    return _OUTPUT.search(body) is not None


def _has_wildcards(body: str) -> bool:
    """Return whether a rule has outputs with wildcards: all but paths that are written without any."""
    outputs = _OUTPUT.search(body)
    return outputs is not None and ("{" in outputs[2] or re.search(r"\"[^\"]*/[^\"]*\"", outputs[2]) is None)


def _without_rule(files: Sequence[str], call: Sequence[str]) -> str | None:
    """Return the first file that is not the output of a rule; None if all are.

    An error of the workflow, such as a rule without inputs, is raised; errors of Snakemake are reported by the run.
    """
    words = [sys.executable, "-m", "snakemake", *files, "--summary", *call]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return None
    for line in done.stderr.splitlines():
        if line.startswith("error: "):
            raise ConfigError(line.removeprefix("error: "))
    missing = _NO_RULE.search(done.stdout + done.stderr)
    return missing[1] if missing else None
