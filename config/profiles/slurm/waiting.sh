#!/usr/bin/env bash
# Lists your pending SLURM jobs whose reason is neither resources nor priority, because these jobs may wait forever.
# Exit code 1 if there are any. To monitor a run: watch -n 60 config/profiles/slurm/waiting.sh
stuck=$(squeue --user="$(id -un)" --states=PENDING --noheader --format='%i %j %C cores %m: %r' |
    grep -Ev ': (None|Resources|Priority|BeginTime|Dependency|Cleaning)$')
[ -z "$stuck" ] || { echo "$stuck"; exit 1; }
