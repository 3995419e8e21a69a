#!/usr/bin/env bash
# Writes every file of spec/results, one ptcbench command after another. Nothing else should run on the
# machine meanwhile.
#
#   tools/measure.sh [--quick] [--list] [--bin DIR] [--work DIR] [--results DIR] [--only NAME] MESH
#
#   MESH            the Stanford dragon, as tools/demo.sh fetches it
#   --quick         takes seconds per file and shows that each command works; its figures mean nothing
#   --list          prints the name and the command of each file, and runs nothing
#   --bin DIR       directory of ptcbench (build/release/bin)
#   --work DIR      directory for facts, tables and temporary files (build/measure)
#   --results DIR   directory for the files of results (spec/results)
#   --only NAME     writes only NAME.md
#
# Paths are relative to the root of the tree. Exit codes: 0 all files are written, 1 some experiments
# failed (their names are printed), 2 usage.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
  echo "measure.sh: $*" >&2
  exit 2
}

quick= list= only= mesh=
bin=build/release/bin
work=build/measure
results=spec/results
while [[ $# -gt 0 ]]; do
  case $1 in
    --bin | --work | --results | --only) [[ $# -gt 1 ]] || usage "$1 needs a value" ;;&
    --quick) quick=1 ;;
    --list) list=1 ;;
    --bin) bin=$2 && shift ;;
    --work) work=$2 && shift ;;
    --results) results=$2 && shift ;;
    --only) only=$2 && shift ;;
    -*) usage "unknown option $1. The head of the script lists the options" ;;
    *) mesh=$1 ;;
  esac
  shift
done
if [[ -n $list ]]; then
  mesh=dragon.ply.gz
elif [[ ! -r $mesh ]]; then
  usage "the mesh '$mesh' cannot be read. Give the mesh of the dragon, which tools/demo.sh fetches"
fi
failed=() known=

# measure NAME EXPERIMENT ARGUMENT... -- QUICK-ARGUMENT...
# Writes NAME.md by `ptcbench EXPERIMENT ARGUMENT...`, or with --quick and the QUICK-ARGUMENTs instead.
measure() {
  local name=$1 experiment=$2 full=() short=()
  shift 2
  while [[ $1 != -- ]]; do full+=("$1") && shift; done
  shift
  short=("$@")
  if [[ -n $list ]]; then
    echo "$name: ptcbench" "$experiment" "${full[@]}"
    return
  fi
  [[ -z $only || $only == "$name" ]] || return 0
  known=1
  local arguments=("${full[@]}")
  [[ -z $quick ]] || arguments=(--quick "${short[@]}")
  echo "==" "$name: ptcbench" "$experiment" "${arguments[@]}"
  "$bin/ptcbench" "$experiment" "${arguments[@]}" --name "$name" -o "$work" --results "$results" --quiet ||
    failed+=("$name")
}

once=(--repeats 1)
measure accuracy accuracy fractal window city "$mesh+backdrop" --quick --points 1M --checked 400 --repeats 5 -- \
  "$mesh+backdrop" --points 2k --checked 10 --reference-rays 64 --set points --method ptcx --method embree-mesh "${once[@]}"
measure build build --points 20M --points 60M --panel points --memory 1G -- --points 20k --panel points "${once[@]}"
measure build-cap build --points 20M --panel cap -- --points 200k --panel cap --cap 96M "${once[@]}"
measure cache cache --quick --points 6M --receivers 16384 --repeats 5 -- --points 20k --receivers 1024 --panel hits --panel receivers "${once[@]}"
measure cache-threads cache --panel threads --receivers 16384 -- \
  --panel threads --points 20k --receivers 1024 "${once[@]}"
measure demo demo "$mesh+backdrop" --memory 256M -- "$mesh+backdrop" --points 5k --checked 20 "${once[@]}"
measure demo-city demo city --points 20M --receivers 100k --memory 256M --stage build --stage verify --stage shade -- \
  city --points 5k --receivers 1k --stage build --stage verify --stage shade "${once[@]}"
measure error error fractal window city "$mesh+backdrop" --points 200k --checked 300 --check-rays 4096 -- \
  "$mesh+backdrop" --points 2k --checked 20 --check-rays 256
measure error-sparse error city --points 2M --set sparse --checked 500 --check-rays 4096 -- \
  city --points 2k --set sparse --checked 20 --check-rays 256
measure farm farm -- --points 20k --parts 2 --shaded 2k "${once[@]}"
measure formats formats -- --points 20k "${once[@]}"
measure glossy glossy city "$mesh" -- city --points 4k --checked 20 "${once[@]}"
measure growth growth --quick --repeats 5 --points 500k --points 2M --points 6M --panel surfels --panel solid-angle --panel depth -- \
  --points 4k --points 8k --checked 10 --panel surfels "${once[@]}"
measure hunt hunt -- --scenes 5
measure instructions instructions -- --points 10k --receivers 1024 --checked 10 "${once[@]}"
measure knob knob -- cornell --points 2k --checked 64 --check-rays 256 --seeds 1 --set points
measure model model fractal window city "$mesh+backdrop" --quick --repeats 5 -- \
  "$mesh+backdrop" --points 2k --checked 10 "${once[@]}"
measure mutations mutations -- --every 40009
measure relight relight fractal window city "$mesh+backdrop" -- fractal --points 4k --checked 50 "${once[@]}"
measure remote remote -- --points 20k
measure rooms rooms -- --points 5k --paths 32
measure scale scale --points 2M --points 6M --points 20M --memory 1G -- --points 20k --points 40k --receivers 100 "${once[@]}"
measure scale-1700m scale --points 20M --points 200M --points 1700M --repeats 1 --memory 2G -- \
  --points 20k --receivers 100 "${once[@]}"
measure scan scan "$mesh" --points 1M --threads 1 -- "$mesh" --points 20k "${once[@]}"
measure sort sort --points 4M --points 20M --memory 1G -- --points 20k "${once[@]}"
measure sort-200m sort --points 200M --panel disk --order city --memory 1G -- \
  --points 20k --panel disk --order city "${once[@]}"
measure specks specks "$mesh" city -- "$mesh" --points 5k --checked 50
measure stability stability -- --row 3 --row 12
measure surfels surfels fractal window cornell "$mesh+backdrop" -- cornell --points 2k "${once[@]}"
measure tolerance tolerance fractal window cornell city "$mesh+backdrop" -- cornell --points 2k --receivers 100 "${once[@]}"
measure truth truth --points 100k --size 128x96 --paths 512 --python python3 -- --paths 32 --points 5k --size 32x24
measure verify verify --points 20M --threads 1 -- --points 20k "${once[@]}"

[[ -n $list || -n $known ]] || usage "there is no result '$only'. --list prints the names"
if [[ ${#failed[@]} -gt 0 ]]; then
  echo "measure.sh: these experiments failed: ${failed[*]}" >&2
  exit 1
fi
