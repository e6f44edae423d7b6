#!/bin/sh
#SBATCH --job-name=splatsim-sweep
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
# A sweep as a Slurm array, one part of its points per task. All tasks write into one folder on a shared file system:
#
#     parts=$(sbatch --parsable --array=1-64 bindings/slurm/sweep.sh plan.json rows)
#     sbatch --dependency=afterany:$parts --wrap 'splatsim sweep plan.json --out rows'
#
# The second job draws the points that failed tasks have left, and writes the table of all rows. A killed task continues after
# `scontrol requeue JOB_TASK`, or after the same two lines again. To draw a few parts again, give the total number of parts:
# `sbatch --array=3,17 bindings/slurm/sweep.sh plan.json rows 64`.
# SPLATSIM is the program, if it is not in PATH.
set -eu
if [ "$#" -lt 2 ] || [ -z "${SLURM_ARRAY_TASK_ID:-}" ]; then
    echo "usage: sbatch --array=1-PARTS $0 PLAN FOLDER [PARTS]" >&2
    exit 2
fi
exec "${SPLATSIM:-splatsim}" sweep "$1" --out "$2" --shard "$SLURM_ARRAY_TASK_ID/${3:-$SLURM_ARRAY_TASK_MAX}" \
    --threads "${SLURM_CPUS_PER_TASK:-1}" --quiet
