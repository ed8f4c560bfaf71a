#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: gl_environments.sh PROGRAM MODELS
# The program where OpenGL is missing, old, or the surroundings are bare: it says so or works, and never crashes. On a
# machine without Mesa's software renderer the cases that need one cannot be had, and that is a failure, too.
set -uo pipefail
bocst=$1
models=$2
failures=0
out=$(mktemp)
image=$out.png
trap 'rm -f "$out" "$image"' EXIT

# What must be said, the exit code, then environment and arguments.
expect() {
  local pattern=$1 code=$2 got=0
  shift 2
  timeout 120 env "$@" >"$out" 2>&1 || got=$?
  if [[ $got -ne $code ]] || ! grep -qE "$pattern" "$out"; then
    echo "FAILED (exit code $got, expected $code; output must match: $pattern): $*"
    cat "$out"
    failures=$((failures + 1))
  fi
}

pair=("$models/link.obj" "$models/gripper.obj")
mesa=(LIBGL_ALWAYS_SOFTWARE=1)
# Without anything but what a sanitizer must leave out.
bare=("${mesa[@]}" ${LSAN_OPTIONS:+"LSAN_OPTIONS=$LSAN_OPTIONS"})
no_driver=(__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent.json)

expect '^compute +no +yes' 0 "${mesa[@]}" "$bocst" oracles
expect '^cpu +no +yes' 0 "${no_driver[@]}" "$bocst" oracles
expect '^compute +no +no: ' 0 "${no_driver[@]}" "$bocst" oracles
expect '^bocst: oracle compute: ' 1 "${no_driver[@]}" "$bocst" collide "${pair[@]}" --oracle compute
expect '^bocst: oracle occlusion: ' 1 "${no_driver[@]}" BOCST_ORACLE=occlusion "$bocst" collide "${pair[@]}"
expect 'They collide' 0 "${no_driver[@]}" "$bocst" collide "${pair[@]}"

old=("${mesa[@]}" MESA_GL_VERSION_OVERRIDE=3.3)
expect '^compute +no +no: .*OpenGL 4\.3' 0 "${old[@]}" "$bocst" oracles
expect '^occlusion +no +yes' 0 "${old[@]}" "$bocst" oracles
expect '^bocst: oracle compute: ' 1 "${old[@]}" "$bocst" collide "${pair[@]}" --oracle compute
expect 'They collide' 0 "${old[@]}" "$bocst" collide "${pair[@]}" --oracle occlusion
expect 'They collide' 0 "${mesa[@]}" MESA_GL_VERSION_OVERRIDE=4.6 "$bocst" collide "${pair[@]}" --oracle compute
expect '^cpu +no +yes' 0 "${mesa[@]}" GALLIUM_DRIVER=softpipe "$bocst" oracles

expect 'no device 99|not one of' 1 "${mesa[@]}" BOCST_ORACLE=99 "$bocst" collide "${pair[@]}"
expect 'They collide' 0 "${mesa[@]}" BOCST_ORACLE=0 "$bocst" collide "${pair[@]}"

# Pictures need a device, whatever the oracle; without one nothing is written.
expect_no_picture() {
  expect "$@"
  [[ ! -e $image ]] || { echo "FAILED: a picture was written: $*"; failures=$((failures + 1)); rm "$image"; }
}
expect_picture() {
  expect "$@"
  [[ $(head -c 4 "$image" | tail -c 3) == PNG ]] || { echo "FAILED: no picture was written: $*"; failures=$((failures + 1)); }
  rm -f "$image"
}
for command in "inspect ${pair[0]}" "collide ${pair[*]}" "validate ${pair[*]} --poses 8"; do
  read -ra words <<<"$command --oracle cpu --image $image"
  expect_no_picture '^bocst: no picture can be drawn: ' 1 "${no_driver[@]}" "$bocst" "${words[@]}"
done
inspect=(inspect "${pair[0]}" --depth 2 --image "$image")
expect_no_picture '^bocst: no picture can be drawn: .*no device 99' 1 "${mesa[@]}" BOCST_ORACLE=99 "$bocst" "${inspect[@]}"
expect_picture '^level' 0 "${mesa[@]}" BOCST_ORACLE=0 "$bocst" "${inspect[@]}"
expect_picture '^level' 0 "${mesa[@]}" BOCST_ORACLE=99 "$bocst" "${inspect[@]}" --oracle cpu
expect_picture '^level' 0 "${old[@]}" "$bocst" "${inspect[@]}"
expect_picture '^level' 0 "${mesa[@]}" GALLIUM_DRIVER=softpipe "$bocst" "${inspect[@]}"
expect_picture '^level' 0 -i "${bare[@]}" "$bocst" "${inspect[@]}"
expect_no_picture '^bocst: no picture can be drawn: .*OpenGL 3\.3' 1 "${mesa[@]}" MESA_GL_VERSION_OVERRIDE=3.1 "$bocst" "${inspect[@]}"

expect '^auto takes cpu' 0 "${no_driver[@]}" "$bocst" oracles
expect '^auto takes occlusion' 0 "${mesa[@]}" BOCST_ORACLE=occlusion "$bocst" oracles
expect '^auto takes none: .*no device 99' 0 "${mesa[@]}" BOCST_ORACLE=99 "$bocst" oracles

# A report names what it could not ask.
report=$(mktemp -d)
trap 'rm -rf "$out" "$image" "$report"' EXIT
expect "^report: $report/paper.md" 0 "${no_driver[@]}" "$bocst" paper "$models/gripper.obj" --frames 70 --out "$report"
for oracle in occlusion compute sampled; do
  grep -q "^| $oracle | not to be had: ." "$report/paper.md" || { echo "FAILED: no word of $oracle"; failures=$((failures + 1)); }
done
expect '^bocst: oracle compute: ' 1 "${no_driver[@]}" "$bocst" paper "$models/gripper.obj" --oracle compute --out "$report"

# No HOME, no DISPLAY, nothing; and as somebody who owns nothing.
expect 'They collide' 0 -i "${bare[@]}" "$bocst" collide "${pair[@]}" --oracle compute
if [[ $EUID -eq 0 ]]; then
  # A copy, since nobody else may read what lies below root's home.
  public=$(mktemp -d)
  trap 'rm -rf "$out" "$image" "$report" "$public"' EXIT
  chmod 755 "$public"
  mapfile -t libraries < <(ldd "$bocst" | awk '/libbocst/ && $3 ~ "^/" { print $3 }')
  cp "$bocst" "${pair[@]}" "${libraries[@]}" "$public"
  expect 'They collide' 0 -i "${bare[@]}" LD_LIBRARY_PATH="$public" setpriv --reuid=65534 --regid=65534 --clear-groups \
    "$public/${bocst##*/}" collide "$public/link.obj" "$public/gripper.obj" --oracle compute
fi

[[ $failures -eq 0 ]] || { echo "$failures failed"; exit 1; }
echo "all as expected"
