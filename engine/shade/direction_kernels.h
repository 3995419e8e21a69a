// The pixel loops of a direction buffer, compiled for every instruction set and chosen at run time.
#pragma once

#include <array>
#include <cstdint>

#include "engine/shade/disc_queue.h"
#include "engine/shade/shading.h"

namespace ptc {

inline constexpr int kPixelLanes = 8;

/// The geometry of a cube of direction pixels. Faces: 0 +x  1 -x  2 +y  3 -y  4 +z  5 -z; w points
/// through a face, u runs along its rows and v along its columns, the axes that follow w cyclically.
struct CubeGeometry {
  const float* centre;    ///< resolution: pixel centres in [-1, 1]
  const float* length;    ///< resolution^2: |(1, u, v)|
  const float* weight;    ///< resolution^2: solid angle over length
  int resolution;         ///< a multiple of kPixelLanes
  float rotation[3][3];   ///< rows: the cube's axes in the world
};

/// What covers each pixel, by face, row and column.
struct CubePixels {
  float* nearness;        ///< 1 / t, t along the ray (1, u, v) of the pixel; 0 where nothing covers
  std::uint32_t* rgbe;
};

/// Covers the pixels whose ray meets a disc before what is there; of equally near ones the lesser
/// colour stays, so the order of drawing does not matter.
void draw_discs(const CubeGeometry& cube, const CubePixels& pixels, const DiscQueue& discs, Sides sides);

/// Sums over the pixels of a face above the horizon.
struct FaceSums {
  float total = 0;                  ///< of weights
  float covered = 0;
  std::array<float, 3> light{};     ///< of weight times colour
  std::array<float, 3> sky{};       ///< of weight times sky where uncovered
  std::array<float, 3> open{};      ///< of weight times direction (w, u, v) where uncovered
};

/// @param pixels  of one face
/// @param sky     3 planes of resolution^2, or null
/// @param nw, nu, nv  the receiver's normal in the axes of the face
void sum_face(const CubeGeometry& cube, const CubePixels& pixels, const float* sky, float nw, float nu, float nv,
              FaceSums& sums);

}  // namespace ptc
