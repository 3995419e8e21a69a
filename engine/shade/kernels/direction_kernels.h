// The pixel loops of a direction buffer: drawing discs, and summing over pixels. They are compiled
// for every instruction set, and the best one is chosen at run time.
//
// A direction buffer is a cube around a viewpoint. A pixel of a face looks along the ray (1, u, v)
// in the face's axes (w, u, v), and what it sees lies at t (1, u, v). The buffer keeps 1 / t, the
// nearness, which is linear in u and v over a plane, and 0 for nothing at all:
//
//     u ^         | w = 1
//       |         |
//       |         * pixel (1, u)       The plane n . x = h lies along the ray at
//       |      .  |                        t     = h / (nw + nu u + nv v),
//       |   .     |                        1 / t = (nw + nu u + nv v) / h.
//       |.        |
//       x---------+------> w           x is the viewpoint; v is left out.
//
// So what covers a pixel has a greater number than nothing, and of two things the nearer one has
// the greater number.
#pragma once

#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/shade/kernels/disc_queue.h"
#include "engine/shade/shading.h"

namespace ptc {

/// The geometry of a cube of direction pixels. Faces: 0 +x  1 -x  2 +y  3 -y  4 +z  5 -z. The axis
/// w points through a face, u runs along its rows and v along its columns; u and v are the axes
/// that follow w cyclically. The arrays are by row, then by column, the same for each face.
struct CubeGeometry {
  /// resolution: pixel centres in [-1, 1], then NaN DiscQueue::kReadLanes times.
  const float* centre;
  const float* inverse_length;  ///< resolution^2: 1 / |(1, u, v)|
  const float* weight;          ///< resolution^2: solid angle over |(1, u, v)|, sr
  /// resolution^2: mean weight of a pixel and the next one in its row; 0 for the last one.
  const float* edge_u;
  /// resolution^2: mean weight of a pixel and the one in the next row; 0 in the last row.
  const float* edge_v;
  int resolution;      ///< a multiple of 16, at most kMaxResolution
  glm::mat3 rotation;  ///< from the world to the cube's axes
};

/// The maximum number of pixels along a cube edge.
inline constexpr int kMaxResolution = 64;

/// The axes of a face of the cube as numbers 0 to 2: w points through the face, u and v follow
/// cyclically.
struct CubeFace {
  int w, u, v;
  float sign;  ///< 1 for the face at +w, -1 for the face at -w

  /// Finds the axes of a face. @param face  0 to 5, as CubeGeometry numbers them
  constexpr explicit CubeFace(int face)
      : w(face / 2), u((w + 1) % 3), v((w + 2) % 3), sign(face % 2 == 0 ? 1.0F : -1.0F) {}

  /// Returns (1, along_u, along_v), a direction through the face, in the axes of the cube.
  [[nodiscard]] glm::vec3 direction(float along_u, float along_v) const {
    glm::vec3 d;
    d[w] = sign;
    d[u] = along_u;
    d[v] = along_v;
    return d;
  }
};

/// What covers each pixel, by face, row and column. Up to 4 rows past the last one are read, and
/// written back unchanged.
///
///     nearness:   31 30        23 22                     4 3         0
///                 [0| exponent   | upper 19 bits of the   | viewpoint ]
///                 [ | of 1 / t   | mantissa of 1 / t      |           ]
struct CubePixels {
  /// 1 / t, where t (1, u, v) is the nearest thing along the pixel's ray, in the unit of the discs;
  /// 0 where nothing covers. The lowest 4 bits number the viewpoint that it was drawn from.
  float* nearness;
  std::uint32_t* rgbe;  ///< radiance of what covers; null leaves colours out
};

/// CubePixels that are only read.
struct PixelView {
  const float* nearness;      ///< as CubePixels has it
  const std::uint32_t* rgbe;  ///< as CubePixels has it; null where there are no colours
};

/// The maximum number of viewpoints whose pixels one cube may hold.
inline constexpr int kViewpoints = 16;

/// Where the receiver lies relative to each viewpoint, in the axes of the cube and the unit of the
/// discs; 0 for a viewpoint at the receiver.
struct ViewOffsets {
  float axis[3][kViewpoints];
};

/// The rows of each face whose pixels matter.
struct FaceRows {
  int first[6];  ///< first row of each face
  int end[6];    ///< one past the last row of each face
};

/// Covers every pixel whose centre ray meets a disc before what was drawn there. Of equally near
/// ones the lesser colour stays, so the order of drawing does not matter.
/// @param rows       pixels in other rows need not be drawn
/// @param discs      their entries past `size` may be read
/// @param sides      both: a back is black, and not drawn within two radii of the viewpoint; front:
///                   no back is drawn
/// @param viewpoint  the number of the point that the discs are relative to, below kViewpoints
/// Source: spec/shading.md#surfels
void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const FaceRows& rows,
                const DiscQueue& discs, Sides sides, unsigned viewpoint);

/// Weights of pixels other than those of a hemisphere by its cosine (Surroundings).
struct PixelWeights {
  bool sphere = false;     ///< every pixel has its solid angle as its weight
  float cone_cos = 0;      ///< pixels whose cosine to the normal is less do not count
  float per_distance = 0;  ///< 1 over the distance from which on nothing covers; 0: no limit; in
                           ///< the unit of the discs
  unsigned falloff = 0;    ///< a thing at the distance d covers (1 - d per_distance)^falloff
};

/// Sums over the pixels above the horizon. The weight of a pixel is its solid angle times the
/// cosine to the normal, sr, or what PixelWeights say.
struct PixelSums {
  float total = 0;  ///< sum of the weights of all pixels, about pi
  float covered =
      0;  ///< sum of the weights of covered pixels, each times its share that is covered
  glm::vec3 light{0};  ///< sum of weight times radiance over covered pixels
  glm::vec3 sky{0};    ///< sum of weight times radiance of the sky over uncovered pixels
  glm::vec3 open{0};   ///< sum of weight times unit direction, in the axes of the cube, over
                       ///< uncovered pixels
};

/// Sums up the pixels above the horizon of a normal.
/// @param sky      3 planes of resolution^2 for each face, or null
/// @param normal   of the receiver, unit, in the axes of the cube
/// @param offsets  moves what was drawn from other viewpoints, to first order: where the nearer of
///                 two neighbouring pixels grows over the other, its light grows with it. Null
///                 moves nothing.
/// @param weights  null: a hemisphere by its cosine. The light of surfaces counts at any distance
/// Source: spec/shading.md#parallax
void sum_pixels(const CubeGeometry& cube, const PixelView& pixels, const float* sky,
                const glm::vec3& normal, const ViewOffsets* offsets, const PixelWeights* weights,
                PixelSums& sums);

}  // namespace ptc
