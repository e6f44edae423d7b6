#!/usr/bin/env bash
# Runs a sweep as an array of a real Slurm, with one controller and one node on this computer: four
# tasks write into one folder, one of them is killed and requeued, and the results are joined. The
# table must be that of one process, except for the columns `host_`.
#
#     sudo tests/programs/slurm.sh [PROGRAM]
#
# Needs root, and Debian's slurm-wlm and munge. The computer's own Slurm and munge are not touched.
# Prints each step, and exits with 0 on success.
set -euo pipefail
program=$(realpath "${1:-target/release/splatsim}")
root=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(mktemp -d)
daemons=()

end() {
    local status=$?
    if [ "$status" -ne 0 ]; then
        scontrol --oneliner show job || true
        tail -n 20 "$folder"/*.log "$folder"/slurm-*.out 2>&1 || true
    fi
    for daemon in "${daemons[@]}"; do
        kill "$daemon" 2>/dev/null || true
    done
    wait || true
    rm -rf "$folder"
}
trap end EXIT

# Repeats a command until it succeeds.
until_well() {
    for _ in $(seq 3000); do
        if "$@" >/dev/null 2>&1; then return; fi
        sleep 0.1
    done
    echo "never came to be: $*"
    return 1
}

free_port() {
    python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])'
}

host=$(hostname -s)
mkdir "$folder/state" "$folder/spool"
cat >"$folder/slurm.conf" <<CONF
ClusterName=splatsim
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket,cred_expire=5
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0
JobCompType=jobcomp/none
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf

dd if=/dev/urandom of="$folder/munge.key" bs=1024 count=1 status=none
chmod 600 "$folder/munge.key"
munged --foreground --force --socket="$folder/munge.socket" --key-file="$folder/munge.key" --pid-file="$folder/munge.pid" \
    --seed-file="$folder/munge.seed" >"$folder/munge.log" 2>&1 &
daemons+=($!)
until_well test -S "$folder/munge.socket"
slurmctld -D -f "$SLURM_CONF" >"$folder/slurmctld.log" 2>&1 &
daemons+=($!)
slurmd -D -f "$SLURM_CONF" >"$folder/slurmd.log" 2>&1 &
daemons+=($!)
until_well sh -c 'sinfo --noheader --format %T | grep -q idle'
echo "slurm: $(sinfo --version), a controller and a node of two processors"

cd "$folder"
# Each point takes long enough that a task can be killed before its last point.
echo '{"splats": {"builtin": "glass-spheres", "count": 20000}}' >scene.json
cat >plan.json <<PLAN
{"scenes": ["scene.json"], "size": [64, 48], "machine": "tiny", "axes": [
    {"field": "gauss.weight", "add_frac_bits": [-2, 0]}, {"field": "fragment.layers", "range": [1, 4, 1]},
    {"field": "timing.raster.fifo", "values": [1, 4]}]}
PLAN
export SPLATSIM=$program
parts=$(sbatch --parsable --array=1-4 "$root/bindings/slurm/sweep.sh" plan.json rows)
until_well sh -c 'test "$(wc -l <rows/points-2-of-4.jsonl)" -ge 2'
job=$(squeue --noheader --jobs="${parts}_2" --format=%A)
kill -9 "$(scontrol listpids "$job" | awk 'NR > 1 && $1 > 0 {print $1; exit}')"
until_well sh -c "scontrol --oneliner show job ${parts}_2 | grep -q JobState=FAILED"
lines=$(wc -l <rows/points-2-of-4.jsonl)
echo "task 2: killed after $((lines - 1)) of 4 rows"
scontrol requeue "${parts}_2"
until_well sh -c "scontrol --oneliner show job ${parts}_2 | grep -q JobState=PENDING"
scontrol update "jobid=${parts}_2" starttime=now
joined=$(sbatch --parsable --dependency="afterany:$parts" --wrap "$program sweep plan.json --out rows")
until_well sh -c "scontrol --oneliner show job $joined | grep -q JobState=COMPLETED"
if [ "$lines" -ge 5 ]; then
    echo "task 2 was over before it was killed"
    exit 1
fi

"$program" sweep plan.json --out alone --quiet
python3 - <<'PYTHON'
import csv


def rows(folder):
    with open(f"{folder}/sweep.csv", newline="") as file:
        return [{name: cell for name, cell in row.items() if not name.startswith("host_")} for row in csv.DictReader(file)]


alone, array = rows("alone"), rows("rows")
assert len(alone) == 16 and alone == array, "the array's rows differ from one process's"
print(f"{len(array)} rows of the array are those of one process")
PYTHON
grep -h "drawn now" slurm-"$joined".out
