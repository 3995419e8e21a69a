#include "engine/scene/sampling/adapted_spacing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/surface_patches.h"

namespace ptc {
namespace {

constexpr double kWide = 4;  // spacing of the first surfels, over the even one
constexpr double kWishPatchSurfels = 1024;
constexpr double kCell = 2;  // of the map, over the even spacing
// A spacing over the even one
constexpr double kFinest = 0.4;
constexpr double kWidest = 4;
constexpr double kContrast = 0.5;  // what a contrast of 1 counts, where a turn of 1 rad counts 1
// Detail of a surface that is flat and evenly lit: its surfels have borders, too
constexpr double kLeastDetail = 0.05;
constexpr double kMostDetail = 1;

/// A stretch of surface, and how much less than the even spacing it asks for.
struct WishedStretch {
  const SurfaceDetail* detail;
  double wish;  ///< a spacing over the even one
};

/// Returns the factor on all wishes that makes as many surfels as the even spacing does.
double even_out(const std::vector<WishedStretch>& stretches) {
  const auto surfels = [&](double factor) {  // over those of the even spacing
    double sum = 0, area = 0;
    for (const WishedStretch& at : stretches) {
      const double spacing = std::clamp(factor * at.wish, kFinest, kWidest);
      sum += at.detail->area / (spacing * spacing);
      area += at.detail->area;
    }
    return sum / area;
  };
  double low = 1e-3, high = 1e3;
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    (surfels(middle) > 1 ? low : high) = middle;
  }
  return high;
}

}  // namespace

std::optional<SpacingMap> adapted_spacing(const PatchSampler& sampler, const RayScene& scene,
                                          double spacing, std::uint32_t first,
                                          const Executor& executor) {
  // Look at the surface
  SamplingOptions wide;
  wide.spacing = kWide * spacing;
  const SpacingField field(wide);
  const SurfacePatches patches(scene.mesh(), field, kWishPatchSurfels, first);
  std::vector<std::vector<SurfaceDetail>> found(patches.size());
  executor.for_each(patches.size(), [&](std::size_t i, unsigned) {
    found[i] = sampler.look_closely(patches.spread(i, PatchSampler::kPointsPerSurfel));
  });
  double light = 0, area = 0;
  for (const auto& patch : found) {
    for (const SurfaceDetail& detail : patch) {
      light += detail.area * detail.light;
      area += detail.area;
    }
  }
  if (!(area > 0)) return std::nullopt;

  // Weigh what was seen
  std::vector<WishedStretch> stretches;
  for (const auto& patch : found) {
    for (const SurfaceDetail& detail : patch) {
      const double contrast = light > 0 ? detail.contrast * area / light : 0;
      const double sum = std::hypot(detail.turn, kContrast * std::min(contrast, 1.0), kLeastDetail);
      stretches.push_back({&detail, 1 / std::sqrt(std::min(sum, kMostDetail))});
    }
  }
  const double factor = even_out(stretches);
  std::vector<SpacingMap::Wish> wishes;
  for (const WishedStretch& at : stretches) {
    const double wanted = spacing * std::clamp(factor * at.wish, kFinest, kWidest);
    for (const glm::dvec3& place : at.detail->places) wishes.push_back({place, wanted});
  }
  return SpacingMap(wishes, kCell * spacing);
}

}  // namespace ptc
