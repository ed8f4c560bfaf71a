#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Does a query about a bocst::Model reach bocst, however the program was built? Builds it in every way and runs it:
# {with <bocst/fcl.h>, without} x {-O0, -O2, -O3} x {static, shared libbocst} x {libbocst before libfcl, after}.
# Each must answer rightly, or refuse with the remedy; the ones with libbocst before libfcl, and the static ones, must answer.
#
# And once for float, of which libfcl has no code, so that the order does not matter.
#
# matrix.sh SOURCE_DIR WORK STATIC_LIB SHARED_LIB LIBFCL CXX [FLAG...]
#   WORK: a directory for what is built here; FLAG: include directories, libraries of FCL, sanitizers.
set -euo pipefail

source=$1 work=$2 static_lib=$3 shared_lib=$4 libfcl=$5
shift 5
compiler=("$1")
shift
compile_flags=() link_flags=()
for flag in "$@"; do
  case $flag in
    -l* | -L* | *.so | *.so.* | *.a) link_flags+=("$flag") ;;
    *) compile_flags+=("$flag") ;;
  esac
done
if command -v ccache > /dev/null; then launcher=(ccache); else launcher=(); fi

mkdir -p "$work"
shared_dir=$(dirname "$shared_lib")
failed=0

compile() { # source object flags...
  "${launcher[@]}" "${compiler[@]}" -std=c++17 "${compile_flags[@]}" "${@:3}" -c "$source/$1.cpp" -o "$work/$2.o"
}

# Runs a program and compares what it does with what it must do: "answers", or "answers or refuses".
check() { # name must command...
  local name=$1 must=$2 status=0 got
  shift 2
  "$@" > "$work/$name.txt" 2> "$work/$name.err" || status=$?
  case $status in
    0) got="answers" ;;
    1) if grep -q 'overlapping models are told to be free' "$work/$name.txt"; then got="misses"; else got="WRONG"; fi ;;
    3) got="refuses" ;;
    *) got="WRONG (exit $status)" ;;
  esac
  local verdict=ok
  if [[ $status == 3 ]] && ! grep -q 'bocst::bocst before fcl' "$work/$name.txt"; then got="WRONG (no remedy)"; fi
  if [[ " $must " != *" $got "* ]]; then
    verdict=FAILED
    failed=1
  fi
  printf '%-32s %-10s %s\n' "$name" "$got" "$verdict"
  if [[ $verdict == FAILED ]]; then sed 's/^/    /' "$work/$name.txt" "$work/$name.err"; fi
}

link_and_check() { # object kind order must
  local object=$1 kind=$2 order=$3 must=$4 libs bocst=$shared_lib
  local name=$kind-$object-$order
  if [[ $kind == static ]]; then bocst=$static_lib; fi
  if [[ $order == before ]]; then libs=("$bocst" "$libfcl"); else libs=("$libfcl" "$bocst"); fi
  local advancement=()
  if [[ $object != float* ]]; then advancement=("$work/advancement-$object.o"); fi
  "${compiler[@]}" "${compile_flags[@]}" "$work/$object.o" "${advancement[@]}" -o "$work/$name" "${libs[@]}" "${link_flags[@]}" \
    "-Wl,-rpath,$shared_dir"
  check "$name" "$must" "$work/$name"
}

objects=()
for optimise in O0 O2 O3; do
  objects+=("$optimise-with" "$optimise-without")
done
objects+=(float-without)

# The longest first: without the header, FCL's whole table of pairs is compiled with advancement.cpp.
sources=()
for optimise in O3 O2 O0; do sources+=("advancement advancement-$optimise-without -$optimise"); done
sources+=("program float-without -O0 -DWITH_FLOAT")
for optimise in O0 O2 O3; do
  sources+=("advancement advancement-$optimise-with -$optimise -DWITH_HEADER" "program $optimise-with -$optimise -DWITH_HEADER"
    "program $optimise-without -$optimise")
done

# As many compilers at a time as there are processors; a failure ends the script.
running=0
for line in "${sources[@]}"; do
  read -r -a words <<< "$line"
  compile "${words[@]}" &
  running=$((running + 1))
  if ((running >= $(nproc))); then
    wait -n
    running=$((running - 1))
  fi
done
while ((running > 0)); do
  wait -n
  running=$((running - 1))
done

for object in "${objects[@]}"; do
  for kind in static shared; do
    for order in before after; do
      must=answers
      if [[ $kind == shared && $order == after && $object != float* ]]; then must="answers or refuses"; fi
      link_and_check "$object" "$kind" "$order" "$must"
    done
  done
done

# The remedies that the complaint names. A sanitizer's own library wants to be the first.
preload=$shared_lib
if [[ " ${compile_flags[*]}" == *-fsanitize=address* ]]; then
  preload="$("${compiler[@]}" -print-file-name=libasan.so) $preload"
fi
check preload-O2-without-after answers env LD_PRELOAD="$preload" "$work/shared-O2-without-after"
check check-off-O2-with-after answers env BOCST_DISPATCH_CHECK=off "$work/shared-O2-with-after"
check code-off-O2-with-after answers env CHECK_OFF=1 "$work/shared-O2-with-after"
# And what the check is for: without it, FCL's own table says "free".
check check-off-O2-without-after misses env BOCST_DISPATCH_CHECK=off "$work/shared-O2-without-after"
check code-off-O2-without-after misses env CHECK_OFF=1 "$work/shared-O2-without-after"
exit $failed
