#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/package/debian-install.sh PACKAGES_DIR
# For a machine that may be spoilt, as root: installs the packages with apt, builds and runs a separate project against
# them, and removes them again. No test of ctest, since it changes the machine.
set -euo pipefail
[[ $# -eq 1 && $EUID -eq 0 ]] || { sed -n 's/^# Usage/usage (as root)/p' "$0" >&2; exit 2; }
packages=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
export DEBIAN_FRONTEND=noninteractive

apt-get update -qq
apt-get install -qq -y --no-install-recommends "$packages"/*.deb
library=$(basename "$(echo "$packages"/libbocst[0-9]*.deb)" | cut -d_ -f1)
for package in "$library" libbocst-dev bocst python3-bocst; do dpkg -s "$package" | grep '^Status: install ok installed'; done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
bocst --version
printf 'OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n' >tetrahedron.off
bocst collide tetrahedron.off tetrahedron.off --json - | grep '"collide": true'

/usr/bin/python3 -c 'import bocst; print(bocst.load_mesh("tetrahedron.off").health().watertight)' | grep True

# Only what a user needs who has libbocst-dev: a compiler and the tool that builds.
apt-get install -qq -y --no-install-recommends g++ cmake make pkg-config
cmake -S "$here" -B with-cmake
cmake --build with-cmake
with-cmake/consumer
read -ra flags <<<"$(pkg-config --cflags --libs bocst-io bocst)"
g++ -std=c++17 "$here/main.cpp" "${flags[@]}" -o consumer
./consumer

apt-get remove -qq -y "$library"
for left in /usr/bin/bocst /usr/include/bocst; do [[ ! -e $left ]] || { echo "FAILED: $left is left"; exit 1; }; done
echo "installed, used and removed"
