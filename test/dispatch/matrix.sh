#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Does a query about a bocst::Model reach bocst, however the program was built? Builds program.cpp in every way and runs it:
# {with <bocst/fcl.h>, without} x {-O0, -O2, -O3} x {static, shared libbocst} x {libbocst before libfcl, after}.
# Each must answer rightly, or refuse with the remedy; the ones with libbocst before libfcl, and the static ones, must answer.
#
# matrix.sh SOURCE WORK STATIC_LIB SHARED_LIB LIBFCL CXX [FLAG...]
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

compile() { # object flags...
  local object=$1
  shift
  "${launcher[@]}" "${compiler[@]}" -std=c++17 "${compile_flags[@]}" "$@" -c "$source" -o "$object"
}

# Runs a program and compares with what it must do: "answers", or "answers or refuses".
check() { # name must command...
  local name=$1 must=$2 status=0 got
  shift 2
  "$@" > "$work/$name.txt" 2> "$work/$name.err" || status=$?
  case $status in
    0) got="answers" ;;
    3) got="refuses" ;;
    *) got="WRONG (exit $status)" ;;
  esac
  local verdict=ok
  if [[ $status == 3 ]] && ! grep -q 'bocst::bocst before fcl' "$work/$name.txt"; then got="WRONG (no remedy)"; fi
  if [[ $got == WRONG* || ($must == answers && $got != answers) || ($must == refuses && $got != refuses) ]]; then
    verdict=FAILED
    failed=1
  fi
  printf '%-34s %-10s %s\n' "$name" "$got" "$verdict"
  if [[ $verdict == FAILED ]]; then sed 's/^/    /' "$work/$name.txt" "$work/$name.err"; fi
}

jobs=$(nproc)
running=0
for optimise in O0 O2 O3; do
  for header in with without; do
    define=()
    [[ $header == with ]] && define=(-DWITH_HEADER)
    compile "$work/$optimise-$header.o" "-$optimise" "${define[@]}" &
    running=$((running + 1))
    if ((running >= jobs)); then
      wait -n
      running=$((running - 1))
    fi
  done
done
wait

for optimise in O0 O2 O3; do
  for header in with without; do
    object=$work/$optimise-$header.o
    for kind in static shared; do
      for order in before after; do
        name=$kind-$optimise-$header-$order
        if [[ $kind == static ]]; then bocst=$static_lib; else bocst=$shared_lib; fi
        if [[ $order == before ]]; then
          libs=("$bocst" "$libfcl")
        else
          libs=("$libfcl" "$bocst")
        fi
        "${compiler[@]}" "${compile_flags[@]}" "$object" -o "$work/$name" "${libs[@]}" "${link_flags[@]}" \
          "-Wl,-rpath,$shared_dir"
        must=answers
        [[ $kind == shared && $order == after ]] && must="answers or refuses"
        check "$name" "$must" "$work/$name"
      done
    done
  done
done

# The two remedies that the complaint names.
check preload-O2-without-after answers env LD_PRELOAD="$shared_lib" "$work/shared-O2-without-after"
check check-off-O2-with-after answers env BOCST_DISPATCH_CHECK=off "$work/shared-O2-with-after"
exit $failed
