#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/package/debian.sh BUILD_DIR
# Makes the Debian packages of a build, looks into them, and builds and runs a separate project against what is in them.
set -euo pipefail
[[ $# -eq 1 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
build=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
fail() { echo "FAILED: $*"; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cpack -G DEB --config "$build/CPackConfig.cmake" -B "$work/packages" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
names=(libbocst-dev)
library=libbocst$(sed -n 's/^set(PACKAGE_VERSION "\([0-9]*\.[0-9]*\)\..*/\1/p' "$build/bocstConfigVersion.cmake")
[[ $(cached BUILD_SHARED_LIBS) != ON ]] || names+=("$library")
[[ $(cached BOCST_BUILD_TOOLS) != ON ]] || names+=(bocst)
[[ $(cached BOCST_BUILD_PYTHON) != ON ]] || names+=(python3-bocst)

field() { dpkg-deb -f "$work/packages/$1"_*.deb "$2"; }
version=$(field libbocst-dev Version)
for name in "${names[@]}"; do
  deb=$(echo "$work/packages/$name"_*.deb)
  [[ -f $deb ]] || fail "no package $name"
  dpkg-deb -x "$deb" "$work/unpacked"
  dpkg-deb -c "$deb" | awk '$1 !~ /^d/ { print $6 }' | sort >"$work/$name.files"
  grep -q "/doc/$name/copyright$" "$work/$name.files" || fail "$name has no copyright file"
  [[ $(field "$name" Version) == "$version" ]] || fail "$name is of another version"
done
twice=$(sort "$work"/*.files | uniq -d)
[[ -z $twice ]] || fail "in two packages: $twice"
[[ $(find "$work/packages" -maxdepth 1 -name '*.deb' | wc -l) == "${#names[@]}" ]] || fail "more packages than these: ${names[*]}"

depends() { # PACKAGE ON...
  local on
  for on in "${@:2}"; do [[ ", $(field "$1" Depends)," == *", "${on}[\ ,]* ]] || fail "$1 does not depend on $on"; done
}
depends libbocst-dev libfcl-dev libeigen3-dev
if [[ $(cached BUILD_SHARED_LIBS) == ON ]]; then
  depends libbocst-dev "$library (= $version)"
  depends "$library" "libfcl0.7*" "libassimp5*" "libpugixml1v5*" "libhwy1*"
  [[ ! -s $work/bocst.files ]] || depends bocst "$library (= $version)" "libfcl0.7*" "libcairo2*" "libmeshoptimizer2*" "liburdfdom-model*"
  if grep -E '\.(h|cmake|pc|so)$' "$work/$library.files"; then fail "$library has files of the dev package"; fi
  dpkg-deb --ctrl-tarfile "$work/packages/$library"_*.deb | tar -xO ./shlibs >"$work/shlibs" || fail "no shlibs"
  for name in libbocst libbocst_io; do
    grep -qx "$name ${library#libbocst} $library (>= $version)" "$work/shlibs" || fail "no shlibs of $name"
    grep -q "/$name\.so\.${library#libbocst}$" "$work/$library.files" || fail "no $name of this soname"
  done
fi
if [[ -s $work/bocst.files ]]; then
  for file in bin/bocst share/man/man1/bocst.1.gz share/bash-completion/completions/bocst; do
    grep -qx "./usr/$file" "$work/bocst.files" || fail "bocst has no $file"
  done
fi

if [[ $(cached BOCST_BUILD_PYTHON) == ON ]]; then
  # Where Debian's interpreter looks; another interpreter has its own folder.
  python=$(cached BOCST_PYTHON)
  folder=$("$python" -c 'import sys; print("python3/dist-packages" if sys.executable.startswith("/usr/bin/")
    else "python%d.%d/site-packages" % sys.version_info[:2])')
  for file in __init__.py __init__.pyi fcl.py fcl.pyi py.typed; do
    grep -qx "./usr/lib/$folder/bocst/$file" "$work/python3-bocst.files" || fail "python3-bocst has no $file"
  done
  depends python3-bocst python3 python3-numpy libfcl0.7
  [[ $(cached BUILD_SHARED_LIBS) != ON ]] || depends python3-bocst "$library (= $version)"
  if [[ -z $(cached BOCST_SANITIZE) ]]; then
    (cd "$work" && PYTHONPATH="$work/unpacked/usr/lib/$folder" "$python" -c '
import bocst, bocst.fcl
a = bocst.fcl.CollisionObject(bocst.Model(bocst.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])))
assert bocst.fcl.collide(a, a) == 1
print("python3-bocst:", bocst.__file__, bocst.__version__)')
  fi
fi

# Documents and examples, with their places to each other.
for file in README.md share/doc/design.md share/doc/pictures/pair.png share/examples/planner/planner.cpp; do
  grep -qx "./usr/share/doc/bocst/$file" "$work/libbocst-dev.files" || fail "libbocst-dev has no $file"
done

# lintian finds no error and no warning, but for the scripts that CPack adds beside our trigger: they call ldconfig, too.
# Where the libraries' folder was chosen by hand, and not lib/<triplet>, pkg-config files cannot be multiarch.
tags=maintscript-calls-ldconfig
[[ $(cached CMAKE_INSTALL_LIBDIR) == lib/* ]] ||
  tags+=,pkg-config-multi-arch-wrong-dir,pkg-config-unavailable-for-cross-compilation
lintian --allow-root --suppress-tags "$tags" --fail-on error,warning --tag-display-limit 0 "$work/packages"/*.deb || fail "lintian"

"$here/run.sh" "$build" "$work/unpacked/usr"
