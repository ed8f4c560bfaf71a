#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/package/pip.sh BUILD_DIR
# Installs the Python package as `pip install .` does, offline and with the module of a build that is there, and by CMake's
# component `python`; uses both from elsewhere.
set -euo pipefail
[[ $# -eq 1 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
build=$(cd "$1" && pwd)
source=$(cd "$(dirname "$0")/../.." && pwd)
python=$(sed -n 's/^BOCST_PYTHON:[A-Z]*=//p' "$build/CMakeCache.txt")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

use() { # FOLDER
  for file in py.typed __init__.pyi fcl.pyi; do
    [[ -e $1/bocst/$file ]] || { echo "FAILED: no $file in $1"; exit 1; }
  done
  (cd "$work" && PYTHONPATH=$1 "$python" -c '
import pathlib, sys, numpy as np, bocst, bocst.fcl as fcl
assert pathlib.Path(bocst.__file__).parent == pathlib.Path(sys.argv[1]) / "bocst", bocst.__file__
model = bocst.Model(bocst.Mesh(np.eye(3), [[0, 1, 2]]))
assert fcl.collide(fcl.CollisionObject(model), fcl.CollisionObject(fcl.Sphere(1))) == 1
assert bocst.collide_poses(model, model, np.eye(4)[None])[0]
print(bocst.__version__, "in", bocst.__file__)' "$1")
}

# A copy, so that nothing is left in the source.
mkdir "$work/source"
cp -r "$source"/{CMakeLists.txt,LICENSE,README.md,pyproject.toml,src} "$work/source"
BOCST_BUILD=$build "$python" -m pip install --no-build-isolation --no-deps --no-index --no-cache-dir --quiet \
  --root-user-action=ignore --target "$work/pip" "$work/source" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
# What pip installed needs neither the build nor its libraries.
if readelf -d "$work"/pip/bocst/*.so* | grep -F "$build"; then echo "FAILED: it looks into the build"; exit 1; fi
[[ $("$python" -c 'import sys; from importlib import metadata; print(next(metadata.distributions(path=[sys.argv[1]])).version)' \
  "$work/pip") == $(sed -n 's/^project(bocst VERSION \([0-9.]*\).*/\1/p' "$source/CMakeLists.txt") ]] ||
  { echo "FAILED: pip's package is of another version"; exit 1; }
use "$work/pip"

for component in library python; do
  cmake --install "$build" --prefix "$work/prefix" --component $component >"$work/log" || { cat "$work/log"; exit 1; }
done
folder=$(find "$work/prefix" -name bocst -type d -path '*-packages/*')
use "$(dirname "$folder")"
