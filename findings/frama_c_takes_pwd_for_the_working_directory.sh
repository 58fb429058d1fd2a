#!/usr/bin/env bash
# Frama-C 25.0 (Debian 12, frama-c-base), started by a program that changes the working directory.
#
# Seen: relative paths of sources are resolved by the environment variable PWD, not by the working directory.  A shell keeps both equal;
# `env -C` and Python's `subprocess.run(cwd=...)` change the directory and leave PWD.  Frama-C then says that the file does not exist, or
# analyses a file of the same name in the folder of PWD without a warning.  Absolute paths help, and an environment without PWD.
#
# Output:
#   file in the working directory alone: [kernel] User Error: source file 'm.c' does not exist
#   file in both folders: in_pwd is analysed
#   without PWD: in_working_directory is analysed
set -euo pipefail
command -v frama-c > /dev/null || { echo "needs frama-c" >&2; exit 2; }
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
mkdir "$place/inner" "$place/outer"
function_of() { echo "int $1(void) { return 0; } int main(void) { return $1(); }"; }
function_of in_working_directory > "$place/inner/m.c"

cd "$place/outer"
analyse() { env -C "$place/inner" "$@" frama-c -eva m.c 2>&1; }
analysed() { grep -o "in_pwd\|in_working_directory" <<<"$1" | head -1; }

seen=$(
  echo "file in the working directory alone: $(analyse | grep Error)"
  function_of in_pwd > m.c
  echo "file in both folders: $(analysed "$(analyse)") is analysed"
  echo "without PWD: $(analysed "$(analyse -u PWD)") is analysed"
)
echo "$seen"
[ "$seen" = "file in the working directory alone: [kernel] User Error: source file 'm.c' does not exist
file in both folders: in_pwd is analysed
without PWD: in_working_directory is analysed" ]
