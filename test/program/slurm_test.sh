#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/program/slurm_test.sh BOCST EXAMPLE_DIR
# The example for clusters as Slurm's job array, for real: a cluster of this machine alone (munged, slurmctld and slurmd, in
# a folder of their own) runs it. A task is cancelled and another one's report is lost; both are asked again by the lines
# that job.slurm names. The merged report is that of a single run.
set -euo pipefail
[[ $# -eq 2 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
example=$(cd "$2" && pwd)
BOCST=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
work=$(mktemp -d /tmp/bocst_slurm.XXXXXX) # short: a socket's path is at most 107 bytes
chmod 755 "$work" # munged wants everybody to reach its socket
export SLURM_CONF=$work/slurm.conf
socket=$work/munge.socket
PATH=$PATH:/usr/sbin
daemons=()
stop() {
  for ((i = ${#daemons[@]} - 1; i >= 0; --i)); do kill "${daemons[i]}" 2>/dev/null && wait "${daemons[i]}" 2>/dev/null; done
  rm -rf "$work"
}
trap stop EXIT
fail() {
  echo "FAILED: $*"
  tail -n 20 "$work"/*.log
  exit 1
}

# A port that is free now, among those that the system gives to nobody.
free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
node=$(hostname -s)
mkdir "$work/state" "$work/spool"
head -c 1024 /dev/urandom >"$work/munge.key"
chmod 400 "$work/munge.key"
cat >"$SLURM_CONF" <<CONF
ClusterName=bocst
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthInfo=socket=$socket
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
NodeName=$node NodeAddr=127.0.0.1 CPUs=2 RealMemory=8192
PartitionName=all Nodes=$node Default=YES
CONF
start() { # NAME COMMAND...
  "${@:2}" >"$work/$1.log" 2>&1 &
  daemons+=($!)
}
start munged munged --foreground --force --key-file="$work/munge.key" --socket="$socket" --pid-file="$work/munged.pid" \
  --seed-file="$work/munge.seed"
start slurmctld slurmctld -D -f "$SLURM_CONF"
start slurmd slurmd -D -f "$SLURM_CONF"
for ((i = 0; i < 300; ++i)); do
  [[ $(sinfo -h -o %T 2>/dev/null) != idle ]] || break
  sleep 0.1
done
[[ $(sinfo -h -o %T 2>/dev/null) == idle ]] || fail "the cluster does not start"

export BOCST TABLE=$example/pairs.csv OUT=$work/reports POSES=203 SHARDS=4 SEED=5
cd "$example"
submit() { sbatch --wait --output="$work/task-%a.log" "$@" job.slurm; }

# All but one, which is cancelled while it waits.
job=$(sbatch --parsable --output="$work/task-%a.log" --begin=now+1hour --array=2 job.slurm)
scancel "$job"
submit --array="1,3-$(./cluster tasks)" || fail "a task failed"
[[ $(./cluster missing) == 2 ]] || fail "left: $(./cluster missing | paste -sd,)"
rm "$OUT/pair-0002/shard-000001.json"
touch -d @1000000000 "$OUT/pair-0001/shard-000001.json"
if ./cluster merge 2>"$work/merge.log"; then fail "merged although reports are missing"; fi
submit --array="$(./cluster missing | paste -sd,)" || fail "a task failed"
[[ -z $(./cluster missing) ]] || fail "left: $(./cluster missing | paste -sd,)"
[[ $(stat -c %Y "$OUT/pair-0001/shard-000001.json") == 1000000000 ]] || fail "a report was made twice"
./cluster merge

number=0
while IFS=, read -r a b; do
  [[ $a != \#* ]] || continue
  number=$((number + 1))
  "$BOCST" validate "$example/$a" "$example/$b" --poses "$POSES" --seed "$SEED" --json "$work/single.json"
  cmp "$work/single.json" "$OUT/pair-000$number/merged.json" || fail "pair $number: the merged report is not that of a single run"
done <"$TABLE"
[[ $number == 2 ]] || fail "$number pairs"

# A task that cannot do its work fails the job.
rm "$OUT/pair-0001/shard-000001.json"
if BOCST=/nonexistent submit --array=1; then fail "a task without a program did not fail"; fi
echo "the merged reports of Slurm's job array are those of single runs"
