#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Usage: test/program/manual_test.sh BUILD_DIR
# The man page and the completion that are installed: sound, and with every command and option that --help shows.
set -euo pipefail
[[ $# -eq 1 ]] || { sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; }
build=$(cd "$1/tools" && pwd)
bocst=$build/bocst
failures=0
fail() { echo "FAILED: $*"; failures=$((failures + 1)); }

lint=$(mandoc -T lint -W warning "$build/bocst.1" | grep -v "missing date" || true)
[[ -z $lint ]] || fail "$lint"
lint=$(shellcheck -s bash "$build/bocst.bash") || fail "$lint"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mandoc -T ascii -O width=1000 "$build/bocst.1" | col -b | expand >"$work/man"

# What --help shows: its subcommands, and the options of each.
commands=$("$bocst" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
[[ $(wc -w <<<"$commands") -ge 6 ]] || fail "--help shows only: $commands"
options_of() { "$bocst" "$1" --help | sed -n 's/^  \(-h,\)\?\(--[a-z-]*\) .*/\2/p' | grep -vx -e --help | sort; }
section_of() { awk -v head="   bocst $1 " 'index($0, "   bocst ") == 1 || /^[A-Z]/ { on = index($0, head) == 1 } on' "$work/man"; }
[[ $(grep -c '^   bocst ' "$work/man") == $(wc -w <<<"$commands") ]] || fail "the man page has other commands"
for command in $commands; do
  in_help=$(options_of "$command")
  [[ $in_help == *--json* ]] || fail "$command --help has no --json"
  in_man=$(section_of "$command" | sed -n 's/^ *\(--[a-z-]*\)\( .*\|$\)/\1/p' | sort)
  [[ $in_help == "$in_man" ]] || fail "options of $command: --help has ${in_help//$'\n'/ } but the man page has ${in_man//$'\n'/ }"
done

# shellcheck source=/dev/null
source "$build/bocst.bash"
# What completes these words; the last one is being typed.
complete_words() {
  COMP_WORDS=(bocst "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  _bocst
  printf '%s\n' ${COMPREPLY[@]+"${COMPREPLY[@]}"} | sort | tr '\n' ' '
}
expect() { # EXPECTED WORDS...
  local found
  found=$(complete_words "${@:2}")
  [[ ${found% } == "$1" ]] || fail "bocst ${*:2}<TAB> gives '$found', not '$1'"
}
cd "$work"
mkdir folder
touch a.off b.OBJ "c d.ply" e.txt f.json
# shellcheck disable=SC2086 # words
expect "$(printf '%s\n' --help --version $commands | sort | tr '\n' ' ' | sed 's/ $//')" ""
expect "inspect" in
expect "octree" inspect a.off --subdivision o
expect "auto compute cpu occlusion sampled" collide a.off a.off --oracle ""
expect "a.off b.OBJ c d.ply folder" inspect ""
expect "c d.ply" collide a.off c
expect "f.json folder" merge f
expect "e.txt" inspect a.off --json e
expect "" inspect a.off --depth ""
for command in $commands; do
  # shellcheck disable=SC2046 # words
  expect "$(printf '%s\n' --help $(options_of "$command") | sort | tr '\n' ' ' | sed 's/ $//')" "$command" --
done
exit $((failures > 0))
