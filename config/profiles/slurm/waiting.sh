#!/usr/bin/env bash
# Prints your SLURM jobs that wait for something other than a free node or their turn, with the reason: these would wait for ever.
# Ends with 1 where there is one. To watch a run: watch -n 60 config/profiles/slurm/waiting.sh
stuck=$(squeue --user="$(id -un)" --states=PENDING --noheader --format='%i %j %C cores %m: %r' |
    grep -Ev ': (None|Resources|Priority|BeginTime|Dependency|Cleaning)$')
[ -z "$stuck" ] || { echo "$stuck"; exit 1; }
