#!/usr/bin/env bash
# One run of a benchmark per task of a Slurm array: slurm-array.sh UNITS OUT, as README.md beside this says. Tasks that
# were lost are run again by the same array: what has a record is left alone.
#SBATCH --cpus-per-task=1
set -euo pipefail
units=$1
record=$2/$SLURM_ARRAY_TASK_ID.json
if [ ! -s "$record" ]; then
    mkdir -p "$2"
    sed -n "${SLURM_ARRAY_TASK_ID}p" "$units" | "${SBDP:-sbdp}" bench run-unit > "$record.part"
    mv "$record.part" "$record"
fi
