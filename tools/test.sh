#!/usr/bin/env bash
# Installs the packages that are missing, builds everything and runs all tests. The output ends with
# the summary of ctest, after the output of each test that failed. A second run builds only what
# changed.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install.sh
mkdir -p build
exec 9>build/.lock
flock 9 # two runs in one tree would build over each other

cmake --preset release
cmake --build --preset release --parallel "$(nproc)" --target all all_verify_interface_header_sets
ctest --preset release --parallel "$(nproc)" --no-tests=error "$@"
