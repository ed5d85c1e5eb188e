#!/usr/bin/env bash
# Submits a job script and prints the job number: submit.sh THREADS MEM_MB MINUTES GPUS [OPTIONS OF SBATCH ...] SCRIPT
set -euo pipefail
threads=$1 mem_mb=$2 minutes=$3 gpus=$4
shift 4
mkdir -p logs/slurm
[ "$gpus" = 0 ] || set -- --gpus="$gpus" "$@"
exec sbatch --parsable --cpus-per-task="$threads" --mem="$mem_mb" --time="$minutes" --output=logs/slurm/%j.log "$@"
