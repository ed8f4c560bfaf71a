#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/package/run.sh BUILD_DIR [PREFIX]
# Builds and runs a separate project against an installation, by CMake's find_package and by pkg-config, and the example
# planner. Without PREFIX the build is installed first, into a prefix of its own.
set -euo pipefail
[[ $# -eq 1 || $# -eq 2 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
build=$(cd "$1" && pwd)
source=$(cd "$(dirname "$0")" && pwd)

# A value that the build was configured with, so that the consumer is built alike.
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
compiler=$(cached CMAKE_CXX_COMPILER)
sanitize=$(cached BOCST_SANITIZE)
export CXXFLAGS="${sanitize:+-fsanitize=$sanitize}"
# As distributions link: what seems to be unused is dropped.
export LDFLAGS="-Wl,--as-needed"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=${2:-$work/prefix}
[[ $# -eq 2 ]] || cmake --install "$build" --prefix "$prefix" >"$work/log" || { cat "$work/log"; exit 1; }

# Code compiled without <bocst/fcl.h> reaches bocst only when its library is looked up before libfcl.
check_order() {
  local first
  first=$(readelf -d "$1" | grep -oE 'lib(bocst|fcl)\.so' | sed 1q || true)
  [[ $first == libbocst.so || $(cached BUILD_SHARED_LIBS) != ON ]] || { echo "FAILED: $first comes first"; exit 1; }
}

# build_project SOURCE: builds it in $work/<its name>
build_project() {
  cmake -S "$1" -B "$work/$(basename "$1")" -G "$(cached CMAKE_GENERATOR)" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$prefix" >"$work/log" || { cat "$work/log"; exit 1; }
  cmake --build "$work/$(basename "$1")"
}

echo "-- find_package"
build_project "$source"
(cd "$work" && package/consumer)
check_order "$work/package/consumer"
check_order "$work/package/host"

echo "-- pkg-config"
libdir=$(dirname "$(find "$prefix" -name pkgconfig -type d)")
export PKG_CONFIG_PATH=$libdir/pkgconfig
read -ra flags <<<"$CXXFLAGS $(pkg-config --cflags --libs bocst-io bocst)"
"$compiler" -std=c++17 -O1 $LDFLAGS "$source/main.cpp" "${flags[@]}" -Wl,-rpath,"$libdir" -o "$work/consumer"
(cd "$work" && ./consumer)
check_order "$work/consumer"
"$compiler" -std=c++17 $LDFLAGS "$source/host.cpp" "${flags[@]}" -o "$work/host"
check_order "$work/host"

echo "-- the example planner"
share=$source/../../share
build_project "$share/examples/planner"
check_order "$work/planner/planner"
"$work/planner/planner" "$share/models/wall.obj" "$share/models/link.obj" 3
"$source/../../tools/make-models" --arm 200 "$work/arm"
"$work/planner/arm" "$work/arm" "$share/models/gripper.obj" --plans 3

if [[ -x $prefix/bin/bocst ]]; then
  echo "-- the installed program"
  (cd "$work" && "$prefix/bin/bocst" collide tetrahedron.off tetrahedron.off)
fi
