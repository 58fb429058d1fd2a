#!/usr/bin/env bash
# ziglang 0.17.1 (PyPI), `zig c++` as a C++ compiler on x86-64.
#
# Seen: without any option the code is for the processor of the machine that compiles (-march=native of g++ and clang++, whose
# default is the baseline): __AVX2__ is defined on a machine that has AVX2.  A file built so may stop elsewhere with an illegal instruction.
# With -target x86_64-linux-gnu alone, or -mcpu=baseline, it is for the baseline.  Of -mcpu and -march the last one counts.
# The usual spelling -march=x86-64 is refused ("unknown CPU: 'x86'"), since a hyphen begins features there; it is x86_64.
#
# Output on a machine with AVX2:
#   (none): AVX2
#   -mcpu=baseline: baseline
#   -target x86_64-linux-gnu: baseline
#   -mcpu=baseline -march=native: AVX2
#   -march=native -mcpu=baseline: baseline
#   -march=x86_64: baseline
#   -march=x86-64: refused
set -euo pipefail
grep -qw avx2 /proc/cpuinfo || { echo "needs a processor with AVX2" >&2; exit 2; }
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet ziglang==0.17.1
export ZIG_GLOBAL_CACHE_DIR="$place/cache"
: > "$place/empty.cpp"

code_for() {
  if ! macros=$("$place/venv/bin/python" -m ziglang c++ "$@" -dM -E "$place/empty.cpp" 2>"$place/errors"); then
    grep -q "unknown CPU: 'x86'" "$place/errors" && echo refused || cat "$place/errors"
  elif grep -q __AVX2__ <<<"$macros"; then echo AVX2
  else echo baseline
  fi
}

seen=$(
  echo "(none): $(code_for)"
  for options in "-mcpu=baseline" "-target x86_64-linux-gnu" "-mcpu=baseline -march=native" "-march=native -mcpu=baseline" \
                 "-march=x86_64" "-march=x86-64"; do
    # shellcheck disable=SC2086  # several words
    echo "$options: $(code_for $options)"
  done
)
echo "$seen"
expected="(none): AVX2
-mcpu=baseline: baseline
-target x86_64-linux-gnu: baseline
-mcpu=baseline -march=native: AVX2
-march=native -mcpu=baseline: baseline
-march=x86_64: baseline
-march=x86-64: refused"
[ "$seen" = "$expected" ]
