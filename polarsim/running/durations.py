"""Durations of jobs, for estimates of the time that a run still needs.

`durations.json` contains durations, seconds per job by rule. `make durations` updates those of the rules of the demo.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Collection
from pathlib import Path

from polarsim.formats.files import read_json, write_json
from polarsim.reporting import USAGE_PATTERN

_SHIPPED = Path(__file__).with_name("durations.json")
UNKNOWN_S = 5.0  # of a rule without measurement


def expected_durations(run: Path, rules: Collection[str]) -> dict[str, float]:
    """Return the expected duration of a job of each rule, seconds: of the previous run, else of the demo."""
    known = {**read_json(_SHIPPED), **measured_durations(run, rules)}
    return {rule: known.get(rule, UNKNOWN_S) for rule in rules}


def measured_durations(run: Path, rules: Collection[str]) -> dict[str, float]:
    """Return the mean duration of the jobs of each rule, seconds, from the logs of a run."""
    found = defaultdict(list)
    for path in sorted(run.glob("logs/*/*.log")):
        # A file is named by rule and wildcards; names of rules may begin with the name of another rule.
        rule = max((rule for rule in rules if f"{path.stem}_".startswith(f"{rule}_")), key=len, default=None)
        seconds = _seconds(path)
        if rule and seconds is not None:
            found[rule].append(seconds)
    return {rule: sum(seconds) / len(seconds) for rule, seconds in found.items()}


def _seconds(path: Path) -> float | None:
    """Return the duration that a log states, seconds; None if the job has not finished or the log is not readable."""
    try:
        found = USAGE_PATTERN.search(path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return float(found[1]) if found else None


if __name__ == "__main__":
    from polarsim.running.targets import stages_of_rules

    known = expected_durations(Path(sys.argv[1]), stages_of_rules(Path.cwd()))
    write_json(_SHIPPED, {rule: round(known[rule], 1) for rule in sorted(known) if known[rule] != UNKNOWN_S})
