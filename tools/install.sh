#!/usr/bin/env bash
# Installs the packages of packages.txt, and those that it is given, where they are missing. It asks
# no questions. When nothing is missing it changes nothing and needs no network.
set -euo pipefail

missing=()
for package in $(<"$(dirname "$0")/packages.txt") "$@"; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $state == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  command -v sudo >/dev/null || {
    echo "install.sh: as root, run: apt-get install ${missing[*]}" >&2
    exit 3
  }
  as_root=(sudo -n)
fi
echo "installing: ${missing[*]}"
"${as_root[@]}" apt-get -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends \
  "${missing[@]}" >/dev/null
