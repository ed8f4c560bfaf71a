#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/package/configure.sh SOURCE_DIR
# Configures bocst in the ways that users do, also where packages are missing, and looks at what would be built.
set -euo pipefail
[[ $# -eq 1 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
source=$(cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
fail() { echo "FAILED: $*"; failed=1; }

configure() { # NAME OPTION...
  local name=$1
  shift
  cmake -S "$source" -B "$work/$name" -G Ninja "$@" >"$work/$name.log" 2>&1 || { cat "$work/$name.log"; fail "$name"; }
}
has() { grep -q "^$2: " <<<"$(ninja -C "$work/$1" -t targets all 2>/dev/null)"; }
expect() { # NAME WANTED... -- UNWANTED...
  local name=$1 wanted=1 target
  shift
  for target; do
    if [[ $target == -- ]]; then
      wanted=0
    elif ((wanted)); then
      has "$name" "$target" || fail "$name does not build $target"
    elif has "$name" "$target"; then
      fail "$name builds $target"
    fi
  done
  echo "$name: seen"
}
without() { printf -- '-DCMAKE_DISABLE_FIND_PACKAGE_%s=TRUE ' "$@"; }

configure plain
expect plain bocst bocst_io bocst_program bocst_manual mesh_test io_test --
configure switch -DBUILD_TESTING=OFF
expect switch bocst bocst_program -- mesh_test
for missing in GTest Doxygen Boost; do
  # shellcheck disable=SC2046
  configure "no-$missing" $(without "$missing" benchmark)
  expect "no-$missing" bocst bocst_program -- mesh_test
  grep -q "tests are not built: $missing missing" "$work/no-$missing.log" || fail "nothing says that $missing is missing"
done
# shellcheck disable=SC2046
configure library -DBOCST_BUILD_IO=OFF -DBOCST_BUILD_TOOLS=OFF $(without assimp pugixml CLI11 nlohmann_json meshoptimizer urdfdom console_bridge)
expect library bocst mesh_test -- bocst_io bocst_program io_test reader_fuzz
configure static -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF
expect static bocst bocst_program -- mesh_test

# A wrong combination says what to do.
if cmake -S "$source" -B "$work/wrong" -G Ninja -DBOCST_BUILD_IO=OFF >"$work/wrong.log" 2>&1; then fail "a program without its reader"; fi
grep -q 'BOCST_BUILD_TOOLS needs BOCST_BUILD_IO' "$work/wrong.log" || fail "nothing says what the program needs"

# On Debian the default is multiarch; a prefix that somebody chose is left alone.
libdir() { sed -n 's/^CMAKE_INSTALL_LIBDIR:PATH=//p' "$work/$1/CMakeCache.txt"; }
if [[ -e /etc/debian_version ]]; then
  [[ $(libdir plain) == lib/*-linux-gnu* ]] || fail "libraries go to $(libdir plain)"
fi
configure prefix -DCMAKE_INSTALL_PREFIX="$work/prefix" -DBUILD_TESTING=OFF
[[ $(libdir prefix) == lib* && $(libdir prefix) != lib/* ]] || fail "with a prefix libraries go to $(libdir prefix)"

# A part of another project.
cmake -S "$source/test/package/subproject" -B "$work/host" -G Ninja -DBOCST_SOURCE="$source" >"$work/host.log" 2>&1 ||
  { cat "$work/host.log"; fail "as a subproject"; }
expect host bocst host -- bocst_io bocst_program mesh_test docs install/strip/local/bocst

# The presets.
cd "$source"
for preset in dev release asan tsan; do
  cmake --preset "$preset" -B "$work/preset-$preset" >"$work/preset-$preset.log" 2>&1 ||
    { cat "$work/preset-$preset.log"; fail "preset $preset"; }
done
expect preset-dev bocst bocst_program mesh_test --
expect preset-release bocst bocst_program -- mesh_test
expect preset-asan bocst bocst_program mesh_test --
expect preset-tsan bocst bocst_program mesh_test --
grep -q -- '-fsanitize=thread' "$work/preset-tsan/build.ninja" || fail "the preset tsan has no ThreadSanitizer"
exit $failed
