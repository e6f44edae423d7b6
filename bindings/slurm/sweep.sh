#!/bin/sh
#SBATCH --job-name=splatsim-sweep
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
# A sweep as an array of Slurm, a part of its points a task; all write into one folder that every node sees:
#
#     parts=$(sbatch --parsable --array=1-64 bindings/slurm/sweep.sh plan.json rows)
#     sbatch --dependency=afterany:$parts --wrap 'splatsim sweep plan.json --out rows'
#
# The second job draws what a task that failed has left, and writes the table of all rows. A task that was killed goes on where it was:
# `scontrol requeue JOB_TASK`, or the same two lines again. To draw a few parts anew, say of how many they are:
# `sbatch --array=3,17 bindings/slurm/sweep.sh plan.json rows 64`.
# SPLATSIM names the program, where it is none of PATH.
set -eu
if [ "$#" -lt 2 ] || [ -z "${SLURM_ARRAY_TASK_ID:-}" ]; then
    echo "usage: sbatch --array=1-PARTS $0 PLAN FOLDER [PARTS]" >&2
    exit 2
fi
exec "${SPLATSIM:-splatsim}" sweep "$1" --out "$2" --shard "$SLURM_ARRAY_TASK_ID/${3:-$SLURM_ARRAY_TASK_MAX}" \
    --threads "${SLURM_CPUS_PER_TASK:-1}" --quiet
