// Scenes that `ptcbench hunt` found among the first 12,000 seeds, as it made them smaller.
#include "tools/bench/hunt/kept_scenes.h"

#include <array>

namespace ptc::bench {
namespace {

constexpr auto kScenes = std::to_array<KeptScene>({
    {"leaves, three receivers", 7094, HuntError::occlusion, 0.05,
     "borders of leaves that one cell draws for three receivers are moved to first order only",
     "leaves at -0.4256 -0.5468 -0.2877 turn 28 38 159 size 0.442 0.171 0.394 spacing 0.0071\n"
     "receiver -0.29 -0.53 -0.27 normal -0.65 -0.56 0.52\n"
     "receiver -0.28 -0.53 -0.25 normal -0.44 0.08 0.9\n"
     "receiver -0.27 -0.55 -0.26 normal 0.31 0.79 -0.52\n"},
    {"black wall just before a white one", 723, HuntError::light, 0.16,
     "a cluster of both walls has their mean",
     "pair size 2 2 2 gap 0.01 spacing 0.04 back 1 1 1\n"
     "receiver 0.3 0.5 1.3 normal -0.6 0.4 -0.7\n"},
    {"wedge of 6 degrees from outside", 11615, HuntError::light, 0.08,
     "a cluster of both sheets is drawn as one thin disc, and its black backs cover too little",
     "sky white\n"
     "wedge at -0.5 -0.97 -0.72 size 0.844 0.251 0.182 gap 6 spacing 0.024 light 1 1 1 back 0.08 "
     "0.07 0.77\n"
     "receiver -0.5 -1 0.1 normal 0.2 -0.5 -0.9\n"},
    {"room in a room of huge discs", 7725, HuntError::light, 0.12,
     "walls that a cell draws and walls that a receiver draws are ordered by depths from two "
     "places",
     "room at -0.05 0 -0.22 size 3.3 3.3 3.3 gap 0.6 spacing 2.1\n"
     "room at -0.6 0.7 -0.3 size 4.8 3.29 3.14 gap 0.2 spacing 0.77 light 1 1 1\n"
     "receiver -0.6 -1 -1.3 normal 0 1 0\n"
     "receiver -0.72 -0.97 -1.33 normal 0 1 0\n"},
    {"two bright and black walls in one plane", 7302, HuntError::light, 0.06,
     "of discs in one plane the cell draws some and the receiver others, and depths from two "
     "places divide them",
     "pair at 0.83 0.71 0.54 turn 0 90 0 size 0.3 0.3 0.3 gap 0.1427 spacing 0.03\n"
     "wedge at 0.6873 0.6612 0.5788 turn 0 90 0 size 0.1 0.1 0.1 gap 20 spacing 0.02 light 1 1 1\n"
     "receiver 0.71 0.72 0.62 normal -0.93 0.36 0\n"
     "receiver 0.709 0.719 0.619 normal -0.934 0.358 0\n"},
    {"sheet near two receivers", 6646, HuntError::light, 0.01,
     "mended: the back of a sheet came before its front",
     "sheet at -0.5991 -0.0739 -0.0246 size 0.628 2.329 1.436 spacing 0.3 light 1 1 1\n"
     "receiver -0.5 -0.4 0.3 normal -0.8 0.4 -0.5\n"
     "receiver -0.45 -0.4 0.28 normal -0.79 0.3 -0.54\n"},
    {"sheet of one pair of discs", 1672, HuntError::mean, 0.03,
     "mended: the back of a sheet came before its front",
     "sheet at -0.75 0.7 0.91 size 0.92 0.897 0.873 spacing 1.3 back 1 1 1\n"
     "receiver -0.14 0.35 -0.22 normal -0.37 0.67 -0.65\n"
     "receiver -0.126 0.3 -0.157 normal -0.57 0.026 0.821\n"},
    {"sheet at two radii", 11190, HuntError::light, 0.01,
     "mended: the back of a sheet came before its front",
     "sky white\n"
     "sheet at -0.58 0.28 0.02 turn 315 285 120 size 1.539 1.07 1.668 spacing 0.5209 light 1 1 1\n"
     "receiver -0.6 -0.2 0.4 normal 0 0 -1\n"
     "receiver -0.54 -0.28 0.43 normal 0 0 1\n"},
    {"black slit on a white disc", 1137, HuntError::light, 0.03,
     "depths from two places decide between layers 0.05 apart",
     "disc at -0.87 0.96 -0.16 size 0.3 0.3 0.3 spacing 0.15 light 1 1 1\n"
     "slit at -0.921 1.0067 -0.1575 gap 0.02 spacing 0.68\n"
     "receiver -0.64 1.19 -0.01 normal -0.74 -0.44 -0.5\n"
     "receiver -0.7 1.2 0 normal -0.6 -0.6 -0.6\n"},
    {"wedge that cuts a box of huge discs", 2678, HuntError::light, 0.07,
     "depths from two places decide where discs cut one another",
     "box at 0.8 -0.5 -0.5 turn 275 3 243 size 3 1 1 spacing 2.01\n"
     "wedge at 1.4 -0.4 0 turn 275 3 243 size 3 3 3 gap 110 spacing 0.72 light 1 1 1\n"
     "receiver 1.4 -1.4 0.1 normal 0.4 -0.1 -0.9\n"
     "receiver 1.32 -1.31 0.09 normal 0.37 -0.13 -0.92\n"},
    {"wall before a slit of huge discs", 2925, HuntError::light, 0.07,
     "depths from two places decide where discs cut one another",
     "slit at -0.1 0.1 -0.4 turn 90 0 0 size 4 4 4 gap 0.15 spacing 2.64 light 1 1 1\n"
     "wall at -0.3 0.1 -1.4 turn 90 0 0 size 2 2 2 spacing 0.21\n"
     "receiver -0.5 -0.5 -1 normal -1 0 0\n"
     "receiver -0.5 -0.4 -0.9 normal -1 0 0\n"},
    {"room with a narrow slit", 3864, HuntError::mean, 0.3,
     "a slit narrower than two pixels counts as chinks, and is open as far as pixels tell",
     "sky white\n"
     "room size 4 4 4 gap 0.25 spacing 0.39\n"
     "receiver 1 -1.23 -1.55 normal 0 0 1\n"},
    {"small bright box at the horizon", 832, HuntError::mean, 0.2,
     "clusters near the horizon are cut by pixels; 0.5 % of white",
     "box at 0.93 -0.39 0.3 turn 90 0 0 size 0.41 0.086 0.15 spacing 0.0177 light 1 1 1\n"
     "receiver 0.9 -0.7 -0.5 normal 0 0 1\n"},
    {"lamp above the floor of a closed room", 2313, HuntError::mean, 0.17,
     "a small lamp that one cell draws for receivers 0.5 apart; 0.6 % of white",
     "room size 3 3 5 spacing 1.22\n"
     "disc at 0.1 -1.2 -2.1 spacing 1.2 light 1 1 1\n"
     "receiver -0.3 1.1 -0.1 normal 0 -1 0\n"
     "receiver -0.5 1.1 0.4 normal 0 -1 0\n"},
    {"small bright slit far aside", 4523, HuntError::mean, 0.16,
     "a thing of few pixels; 0.3 % of white",
     "slit at -0.6 0.7 -0.9 turn 165 285 330 size 0.6 0.1 0.2 gap 0.0011 spacing 0.05 light 1 1 1\n"
     "receiver -0.8 0.1 -0.9 normal 0.5 0.9 0\n"},
    {"bright and black walls in one plane, closer", 7302, HuntError::light, 0.19,
     "of discs in one plane the cell draws some and the receiver others, and depths from two "
     "places divide them",
     "pair at 0.83 0.71 0.54 turn 0 90 0 size 0.3 0.3 0.3 gap 0.1427 spacing 0.03\n"
     "wedge at 0.6873 0.6612 0.5788 turn 0 90 0 size 0.1 0.1 0.1 gap 20 spacing 0.01 light 1 1 1\n"
     "receiver 0.71 0.73 0.63 normal -0.93 0.36 0\n"
     "receiver 0.713 0.73 0.629 normal -0.934 0.358 0\n"},
    {"pair of walls, two receivers", 7661, HuntError::light, 0.13,
     "depths from two places decide between walls close together",
     "pair at -0.6 0.95 0.92 size 1.828 3.176 2.087 gap 0.0021 spacing 0.12 light 1 1 1\n"
     "receiver 0.069 0.295 1.041 normal -0.821 -0.442 -0.362\n"
     "receiver 0.07 0.29 1.05 normal -0.82 -0.44 -0.36\n"},
});

}  // namespace

std::span<const KeptScene> kept_scenes() {
  return kScenes;
}

}  // namespace ptc::bench
