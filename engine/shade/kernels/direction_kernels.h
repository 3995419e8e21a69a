// The pixel loops of a direction buffer, compiled for every instruction set and chosen at run time.
#pragma once

#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/shade/kernels/disc_queue.h"
#include "engine/shade/shading.h"

namespace ptc {

/// The geometry of a cube of direction pixels. Faces: 0 +x  1 -x  2 +y  3 -y  4 +z  5 -z; w points
/// through a face, u runs along its rows and v along its columns, the axes that follow w
/// cyclically.
struct CubeGeometry {
  const float*
      centre;  ///< resolution: pixel centres in [-1, 1]; then DiscQueue::kReadLanes times NaN
  const float* inverse_length;  ///< resolution^2: 1 / |(1, u, v)|
  const float* weight;          ///< resolution^2: solid angle over length
  const float*
      edge_u;  ///< resolution^2: mean weight of a pixel and the next in its row, 0 for the last
  const float* edge_v;  ///< resolution^2: mean weight of a pixel and the one in the next row
  int resolution;       ///< a multiple of 16, at most 64
  glm::mat3 rotation;   ///< from the world to the cube's axes
};

inline constexpr int kMaxResolution = 64;

/// Axes of a face of the cube: w points through it, u and v follow cyclically.
struct CubeFace {
  int w, u, v;
  float sign;  ///< of the face along w

  constexpr explicit CubeFace(int face)
      : w(face / 2), u((w + 1) % 3), v((w + 2) % 3), sign(face % 2 == 0 ? 1.0F : -1.0F) {}
};

/// What covers each pixel, by face, row and column. Up to 4 rows past the last are read, and
/// written as they are.
struct CubePixels {
  /// 1 / t, t along the ray (1, u, v) of the pixel; 0 where nothing covers. The lowest 4 bits say
  /// which viewpoint it was drawn from.
  float* nearness;
  std::uint32_t* rgbe;  ///< null: colours are left out
};

/// The same, to be read.
struct PixelView {
  const float* nearness;
  const std::uint32_t* rgbe;
};

/// Viewpoints whose pixels one cube may hold.
inline constexpr int kViewpoints = 16;

/// Where the receiver lies relative to each viewpoint, in the axes of the cube; 0 where they are
/// the same.
struct ViewOffsets {
  float axis[3][kViewpoints];
};

/// Rows of each face whose pixels matter: from `first` up to `end`.
struct FaceRows {
  int first[6];
  int end[6];
};

/// Covers the pixels whose ray meets a disc before what is there; of equally near ones the lesser
/// colour stays, so the order of drawing does not matter.
/// @param rows       others may be left as they are
/// @param viewpoint  what the discs are relative to, below kViewpoints
void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                const DiscQueue& discs, Sides sides, unsigned viewpoint);

/// Sums over the pixels above the horizon.
struct PixelSums {
  float total = 0;  ///< of weights
  float covered = 0;
  glm::vec3 light{0};  ///< of weight times colour
  glm::vec3 sky{0};    ///< of weight times sky where uncovered
  glm::vec3 open{0};   ///< of weight times direction, in the axes of the cube, where uncovered
};

/// @param sky      of each face 3 planes of resolution^2, or null
/// @param normal   the receiver's, in the axes of the cube
/// @param offsets  moves what was drawn from other viewpoints, to first order: where the nearer of
/// two
///                 neighbouring pixels grows over the other, light follows. Null: nothing moves
void sum_pixels(const CubeGeometry& cube, const PixelView& pixels, const float* sky,
                const glm::vec3& normal, const ViewOffsets* offsets, PixelSums& sums);

}  // namespace ptc
