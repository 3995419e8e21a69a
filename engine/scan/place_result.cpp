// A radius follows from the area A that each point stands for and from the shape of the cells. Of n
// neighbours within the reach R, each stands for pi R^2 / n. The disc circumscribes the cell:
//
//     +-----+        square cell:  r = sqrt(A / 2)
//     |\    |
//     |  .  |  s     cells q times as long as wide, as between scan lines:
//     |    \|
//     +-----+            r = sqrt(A (q + 1 / q)) / 2
//
// How long cells are is told by the directions to the nearest neighbours, averaged over the places
// around: along lines they point one way. Where points lie on lines so far apart that the nearest
// neighbours are all on one line, the distances to the nearest neighbours in eight directions tell
// how far the next line is. The same distances tell where the spacing changes: a point at the
// border of a dense region has most of its neighbours there, and the others far away.
#include "engine/scan/place_result.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/base/numbers.h"
#include "engine/scan/scan.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr float kLonely = 10;         // spacings to the nearest neighbour of an isolated point
constexpr float kApart = 2.5F;        // the same for one that also lies off the surface
constexpr float kOff = 1.5F;          // spacings by which it lies off
constexpr float kOffNoise = 5;        // the same in units of the noise
constexpr float kNoSurface = 0.8F;    // flatness below which neighbours lie on no surface
constexpr float kStep = 1.8F;         // radii to a gap from which on the disc reaches across it
constexpr float kAsideStep = 1.15F;   // the same where neighbours lie to one side
constexpr float kAside = 0.25F;       // where their mean says so
constexpr float kRim = 0.2F;          // where the neighbours' mean begins to tell of a rim
constexpr float kHalfDisc = 0.4244F;  // 4 / (3 pi): distance of a half disc's mean
constexpr float kClear = 2;           // RMS of the noise above which few discs of a surface lie
constexpr float kLines = 0.8F;        // share by which directions differ when all lie on a line

/// Returns the length of cells over their width, from how unevenly directions are spread: 0 in all
/// directions alike, 1 along a line.
float elongation(float uneven) noexcept {
  // For grids of 1, 1.5, 2 and 3 to 1 the unevenness is 0, 0.15, 0.35 and 0.75.
  return 1 + 2.7F * std::max(0.0F, uneven - 0.05F);
}

/// Returns how unevenly the directions of a place and of those around it are spread in its plane.
float unevenness(const ScanChunk& chunk, std::size_t i) noexcept {
  std::array<float, 6> sum = chunk.fits[i].directions;
  for (const std::uint32_t j : chunk.links[i]) {
    if (j == kNoLink) continue;
    for (std::size_t k = 0; k < 6; ++k) sum[k] += chunk.fits[j].directions[k];
  }
  // Take the tensor in a frame of the plane.
  const std::array<float, 3>& n = chunk.fits[i].normal;
  const float sign = std::copysign(1.0F, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
  const std::array<float, 3> u{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]};
  const std::array<float, 3> v{b, sign + n[1] * n[1] * a, -n[1]};
  const auto entry = [&](const std::array<float, 3>& x, const std::array<float, 3>& y) {
    return sum[0] * x[0] * y[0] + sum[1] * x[1] * y[1] + sum[2] * x[2] * y[2] +
           sum[3] * (x[1] * y[2] + x[2] * y[1]) + sum[4] * (x[2] * y[0] + x[0] * y[2]) +
           sum[5] * (x[0] * y[1] + x[1] * y[0]);
  };
  const float uu = entry(u, u), vv = entry(v, v), uv = entry(u, v);
  const float trace = uu + vv;
  return trace > 0 ? std::sqrt((uu - vv) * (uu - vv) + 4 * uv * uv) / trace : 0;
}

/// Returns the radius of a place in lattice units.
float radius_of(const ScanChunk& chunk, std::size_t i) noexcept {
  const PlaceFit& fit = chunk.fits[i];
  if (fit.count == 0) return 0;
  // Find the area that it stands for: noise lengthens distances, and at a rim half the disc is
  // empty.
  const float squared = fit.reach * fit.reach;
  const float flat = std::max(squared - 2 * fit.noise * fit.noise, squared / 2);
  const float rim = std::clamp((fit.aside - kRim) / (kHalfDisc - kRim), 0.0F, 1.0F);
  const float area = kPi * flat / static_cast<float>(fit.count) * (1 - rim / 2);
  // Find the shape of its cell.
  const float uneven = unevenness(chunk, i), q = elongation(uneven);
  const float radius = std::sqrt(area * (q + 1 / q)) / 2;
  const float step = fit.aside > kAside ? kAsideStep : kStep;
  const bool reaches = uneven > kLines || fit.gap / 2 > step * radius;
  return reaches ? std::max(radius, fit.gap / 2) : radius;
}

std::uint8_t facts_of(const PlaceFit& fit) noexcept {
  if (fit.count < kPlaneNeighbours) return 0;
  const bool off = fit.offset > std::max(kOff * fit.spread, kOffNoise * fit.noise);
  const bool isolated =
      fit.nearest > kLonely * fit.spread || (off && fit.nearest > kApart * fit.spread);
  return static_cast<std::uint8_t>((isolated ? kIsolated : 0) |
                                   (fit.flatness < kNoSurface ? kScattered : 0));
}

/// Returns how far a receiver must rise above a place to stand clear of the noise of its surface,
/// in eighths of a radius.
/// @param height  of the surface above the place, on the side of the receiver
std::uint8_t rise_of(const PlaceFit& fit, float height, float radius) noexcept {
  if (!(radius > 0) || fit.count < kPlaneNeighbours) return 0;
  const float steps = 8 * (height + kClear * fit.noise) / radius;
  return static_cast<std::uint8_t>(std::clamp(steps + 0.5F, 0.0F, float{kMostRise}));
}

/// Returns a length in quarters of an octave, roughly.
std::uint8_t octave_of(float length) noexcept {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(std::max(length, 1.0F));
  return static_cast<std::uint8_t>((bits - 0x3f800000) >> 21);
}

}  // namespace

void make_results(const ScanChunk& chunk, const ChunkPieces& pieces, double unit,
                  std::vector<PlaceResult>& results) {
  results.resize(chunk.places.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    const PlaceFit& fit = chunk.fits[i];
    const float spacing = fit.count > 0 ? fit.reach / std::sqrt(static_cast<float>(fit.count)) : 0;
    const float radius = radius_of(chunk, i);
    const float height = fit.to_surface[0] * fit.normal[0] + fit.to_surface[1] * fit.normal[1] +
                         fit.to_surface[2] * fit.normal[2];
    results[i] = {.normal = encode_octahedral(fit.normal),
                  .radius = static_cast<float>(static_cast<double>(radius) * unit),
                  .piece = pieces.of[i],
                  .facts = facts_of(fit),
                  .octave = octave_of(spacing),
                  .rise = {rise_of(fit, height, radius), rise_of(fit, -height, radius)}};
  }
}

double length_of_octave(std::uint64_t octave) noexcept {
  // Within an octave the steps are even, as the upper bits of a mantissa are.
  return std::ldexp(1 + 0.25 * static_cast<double>(octave % 4 + 1), static_cast<int>(octave / 4));
}

std::array<std::int16_t, 2> flip_octahedral(const std::array<std::int16_t, 2>& normal) noexcept {
  // The other half of the octahedron is folded over the sides: the sign of each number stays with
  // its axis, and its magnitude is what the other leaves.
  constexpr int kCorner = 32767;
  const int u = std::max<int>(normal[0], -kCorner), v = std::max<int>(normal[1], -kCorner);
  const int across = kCorner - std::abs(v), along = kCorner - std::abs(u);
  return {static_cast<std::int16_t>(u < 0 ? across : -across),
          static_cast<std::int16_t>(v < 0 ? along : -along)};
}

}  // namespace ptc
