#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/program/cluster_test.sh BOCST EXAMPLE_DIR
# The example for clusters: tasks run by GNU parallel and as a task of a job array, some are lost and asked again, and the
# merged report is that of a single run.
set -euo pipefail
[[ $# -eq 2 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
example=$(cd "$2" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
BOCST=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
cd "$work"
export BOCST TABLE=$example/pairs.csv OUT=$work/reports POSES=203 SHARDS=4 SEED=5
cluster=$example/cluster
fail() { echo "FAILED: $*"; exit 1; }

[[ $("$cluster" tasks) == 8 ]] || fail "there are $("$cluster" tasks) tasks"
[[ $("$cluster" missing | wc -l) == 8 ]] || fail "not all tasks are missing at first"
if "$cluster" merge >out 2>&1; then fail "merged nothing"; fi
grep -q '8 of 8 reports are missing' out || fail "$(cat out)"
if "$cluster" one 9 >out 2>&1; then fail "there is a task 9"; fi
if "$cluster" one 0 >out 2>&1; then fail "there is a task 0"; fi

# As a task of a job array; then all others by GNU parallel.
SLURM_SUBMIT_DIR=$example SLURM_ARRAY_TASK_ID=3 "$example/job.slurm"
[[ $("$cluster" missing | paste -sd,) == 1,2,4,5,6,7,8 ]] || fail "left after one: $("$cluster" missing | paste -sd,)"
"$cluster" missing | parallel --will-cite -j2 "$cluster" one
[[ -z $("$cluster" missing) ]] || fail "left after all: $("$cluster" missing)"

# One is lost and one was cut off; both are asked again, the others are left as they are.
rm "$OUT/pair-0002/shard-000002.json"
: >"$OUT/pair-0001/shard-000004.json"
[[ $("$cluster" missing | paste -sd,) == 4,6 ]] || fail "lost: $("$cluster" missing | paste -sd,)"
touch -d @1000000000 "$OUT/pair-0001/shard-000001.json"
"$cluster" missing | parallel --will-cite "$cluster" one
[[ $(stat -c %Y "$OUT/pair-0001/shard-000001.json") == 1000000000 ]] || fail "a report was made twice"
"$cluster" merge

number=0
while IFS=, read -r a b; do
  [[ $a != \#* ]] || continue
  number=$((number + 1))
  "$BOCST" validate "$example/$a" "$example/$b" --poses "$POSES" --seed "$SEED" --json single.json
  cmp single.json "$OUT/pair-000$number/merged.json" || fail "pair $number: the merged report is not that of a single run"
done <"$TABLE"
[[ $number == 2 ]] || fail "$number pairs"

# A wrong answer fails the merge: a report that says so is enough.
sed -i 's/"mismatches": 0/"mismatches": 1/' "$OUT/pair-0001/shard-000002.json"
if "$cluster" merge >out 2>&1; then fail "a mismatch was merged in silence"; fi
echo "the merged reports are those of single runs"
