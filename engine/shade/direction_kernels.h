// The pixel loops of a direction buffer, compiled for every instruction set and chosen at run time.
#pragma once

#include <array>
#include <cstdint>

namespace ptc {

/// Pixels of one cube face; resolution is a multiple of kPixelLanes.
struct FacePixels {
  float* depth;            ///< infinity where nothing covers
  std::uint32_t* rgbe;
  const float* centre;     ///< resolution: pixel centres in [-1, 1]
  const float* length;     ///< resolution^2: |(1, u, v)|
  const float* weight;     ///< resolution^2: solid angle over length
  int resolution;
};

inline constexpr int kPixelLanes = 8;

/// A disc in the axes of a face: w through the face, u along rows, v along columns.
struct FaceDisc {
  float cw, cu, cv;  ///< centre
  float nw, nu, nv;  ///< unit normal
  float radius;
  std::uint32_t rgbe;
  int x0, x1, y0, y1;  ///< pixels that it may touch
};

/// Covers the pixels whose ray (1, u, v) meets the disc before what is there; at equal depth the
/// lesser colour wins, so the order of drawing does not matter.
void draw_face_disc(const FacePixels& pixels, const FaceDisc& disc);

/// Sums over the pixels of a face above the horizon.
struct FaceSums {
  float total = 0;                  ///< of weights
  float covered = 0;
  std::array<float, 3> light{};     ///< of weight times colour
  std::array<float, 3> sky{};       ///< of weight times sky where uncovered
  std::array<float, 3> open{};      ///< of weight times direction (w, u, v) where uncovered
};

/// @param sky     3 planes of resolution^2, or null
/// @param nw, nu, nv  the receiver's normal in the axes of the face
void sum_face(const FacePixels& pixels, const float* sky, float nw, float nu, float nv, FaceSums& sums);

}  // namespace ptc
