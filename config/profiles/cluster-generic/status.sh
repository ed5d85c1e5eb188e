#!/usr/bin/env bash
# Prints running, success or failed for a job number, from the controller or else from accounting if available.
state=$(scontrol --oneliner show job "$1" 2>/dev/null | grep -o 'JobState=[A-Z_]*' | cut -d= -f2)
[ -n "$state" ] || state=$(sacct -j "$1" -X -n -o State 2>/dev/null | awk '{print $1; exit}')
case $state in
    COMPLETED) echo success ;;
    PENDING | CONFIGURING | RUNNING | COMPLETING | SUSPENDED | REQUEUED | REQUEUE_HOLD | RESIZING) echo running ;;
    *) echo failed ;;
esac
