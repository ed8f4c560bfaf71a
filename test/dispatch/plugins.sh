#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
#
# A planner as a plugin: the process that opens it knows nothing of bocst. Builds program.cpp, which does not include
# <bocst/fcl.h>, as a plugin that links libbocst before libfcl, and opens it from programs that are linked in several
# ways, and from Python. Each must answer rightly, or refuse with the remedy.
#
# plugins.sh SOURCE_DIR WORK LIBBOCST LIBFCL PYTHON CXX [FLAG...]
set -euo pipefail

source=$1 work=$2 libbocst=$3 libfcl=$4 python=$5
shift 5
compiler=("$1")
shift
flags=("$@")
if command -v ccache > /dev/null; then launcher=(ccache); else launcher=(); fi
mkdir -p "$work"
failed=0

"${launcher[@]}" "${compiler[@]}" -std=c++17 -O2 -fPIC "${flags[@]}" -c "$source/program.cpp" -o "$work/planner.o"
# FCL's table of conservative advancement compiles for a minute when optimised. Clang has no symbols that are unique in a
# process, so there the plugin must do as share/doc/planners.md says.
advancement=(-O0)
if "${compiler[@]}" --version | grep -q clang; then advancement+=(-DWITH_HEADER); fi
"${launcher[@]}" "${compiler[@]}" -std=c++17 "${advancement[@]}" -fPIC "${flags[@]}" -c "$source/advancement.cpp" \
  -o "$work/advancement.o"
"${compiler[@]}" -shared "$work/planner.o" "$work/advancement.o" -o "$work/planner.so" "$libbocst" "$libfcl" -lccd -loctomap -loctomath \
  "-Wl,-rpath,$(dirname "$libbocst")"

check() { # name must command...
  local name=$1 must=$2 status=0 got verdict=ok
  shift 2
  "$@" > "$work/$name.txt" 2>&1 || status=$?
  case $status in
    0) got=answers ;;
    1) if grep -q 'overlapping models are told to be free' "$work/$name.txt"; then got=misses; else got=WRONG; fi ;;
    3) if grep -q -- '-Wl,--no-as-needed -lbocst' "$work/$name.txt"; then got=refuses; else got="refuses without the remedy"; fi ;;
    *) got="exit $status" ;;
  esac
  [[ $got == "$must" ]] || { verdict=FAILED; failed=1; }
  printf '%-28s %-10s %s\n' "$name" "$got" "$verdict"
  if [[ $verdict == FAILED ]]; then sed 's/^/    /' "$work/$name.txt"; fi
}

host() { # name flags...: a program that is linked so; --as-needed is what many linkers are told first
  local name=$1
  shift
  "${compiler[@]}" -std=c++17 "$source/host.cpp" -o "$work/$name" -Wl,--as-needed "$@" -ldl "-Wl,-rpath,$(dirname "$libbocst")"
}
needs() { readelf -d "$1" | grep -q "NEEDED.*$2" || { echo "FAILED: $1 does not need $2"; failed=1; }; }
keep() { echo "-Wl,--push-state,--no-as-needed,$1,--pop-state"; }

# Nobody loaded libfcl before: the plugin's own order counts.
host bare
check bare answers "$work/bare" "$work/planner.so"

# The program has libfcl, and without the remedy the linker drops libbocst.
host dropped "$libbocst" "$(keep "$libfcl")"
if readelf -d "$work/dropped" | grep -q 'NEEDED.*libbocst'; then echo "FAILED: libbocst was not dropped"; failed=1; fi
check dropped refuses "$work/dropped" "$work/planner.so"
check dropped-preload answers env LD_PRELOAD="$libbocst" "$work/dropped" "$work/planner.so"
check dropped-check-off misses env CHECK_OFF=1 "$work/dropped" "$work/planner.so"

# The remedy of the message, and what pkg-config says.
host remedy -Wl,--no-as-needed "$libbocst" "$libfcl"
needs "$work/remedy" libbocst
check remedy answers "$work/remedy" "$work/planner.so"
host kept "$libbocst" "$(keep "$libbocst")" "$(keep "$libfcl")"
needs "$work/kept" libbocst
check kept answers "$work/kept" "$work/planner.so"

# Python, with us first and with FCL first.
call='import ctypes, sys; [ctypes.CDLL(l, mode) for l, mode in zip(sys.argv[2:], [getattr(ctypes, sys.argv[1])] * 9)];
sys.exit(ctypes.CDLL(sys.argv[-1]).planner())'
for mode in RTLD_LOCAL RTLD_GLOBAL; do
  check "python-bocst-first-$mode" answers "$python" -c "$call" $mode "$libbocst" "$libfcl" "$work/planner.so"
  check "python-fcl-first-$mode" refuses "$python" -c "$call" $mode "$libfcl" "$work/planner.so"
done
# libfcl for all, but not libbocst: a plugin that brings a solver would reach libfcl's own function.
mixed='import ctypes, sys; ctypes.CDLL(sys.argv[1], ctypes.RTLD_LOCAL); ctypes.CDLL(sys.argv[2], ctypes.RTLD_GLOBAL);
sys.exit(ctypes.CDLL(sys.argv[3]).planner())'
check python-fcl-global refuses "$python" -c "$mixed" "$libbocst" "$libfcl" "$work/planner.so"
check python-alone answers "$python" -c "$call" RTLD_LOCAL "$work/planner.so"
check python-preload answers env LD_PRELOAD="$libbocst" "$python" -c "$call" RTLD_LOCAL "$libfcl" "$work/planner.so"

# A query while the plugin is still being loaded, from a thread that its initialiser waits for.
"${launcher[@]}" "${compiler[@]}" -std=c++17 -O2 -fPIC "${flags[@]}" -c "$source/initializer.cpp" -o "$work/initializer.o"
"${compiler[@]}" -shared -pthread "$work/initializer.o" -o "$work/initializer.so" "$libbocst" "$libfcl" \
  "-Wl,-rpath,$(dirname "$libbocst")"
check initializer answers timeout 60 "$work/bare" "$work/initializer.so"

# Geometries without type information.
"${launcher[@]}" "${compiler[@]}" -std=c++17 -O2 -fno-rtti "${flags[@]}" -c "$source/no_rtti.cpp" -o "$work/no_rtti.o"
"${compiler[@]}" "$work/no_rtti.o" -o "$work/no_rtti" "$(keep "$libbocst")" "$(keep "$libfcl")" \
  "-Wl,-rpath,$(dirname "$libbocst")"
needs "$work/no_rtti" libbocst
check no-rtti answers "$work/no_rtti"
exit $failed
