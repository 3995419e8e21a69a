// Turns a mesh into surfels, one patch of some 8192 surfels at a time. Patches depend on nothing
// but the mesh and the options, so threads make them in any number and they come out in order.
#include "engine/scene/sampling/sampler.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "engine/base/error.h"
#include "engine/scene/sampling/adapted_spacing.h"
#include "engine/scene/sampling/patch_sampler.h"
#include "engine/scene/sampling/patch_stream.h"
#include "engine/scene/sampling/places_by_area.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/sub_triangle.h"
#include "engine/scene/sampling/surface_patches.h"

namespace ptc {
namespace {

constexpr double kPatchSurfels = 8192;
constexpr double kMaxAcross = 3e5;  // spacings along the side of a square as large as the mesh

class MeshSource final : public PatchStream {
 public:
  MeshSource(const DirectLight& light, const RayScene& scene, const SamplingOptions& options,
             const Executor& executor, unsigned at_once, std::uint32_t first)
      : PatchStream(executor, at_once),
        sampler_(scene, &light, options.lights, options.keeps_dark),
        field_({.spacing = 1}) {
    const SamplingOptions known = with_spacing(
        options, options.spacing > 0 ? sampled_area(scene.mesh())
                                     : seen_area(light, scene, options.lights, executor));
    if (known.adapts) map_ = adapted_spacing(sampler_, scene, known.spacing, first, executor);
    field_ = SpacingField(known, map_ ? &*map_ : nullptr);
    patches_.emplace(scene.mesh(), field_, kPatchSurfels, first);
    if (map_) keep_number(scene.mesh(), known, first);
  }

 private:
  /// Scales the map so that there are as many surfels as an even spacing makes. A map alone makes
  /// more, because a piece of surface has the finest spacing that is asked for in it.
  void keep_number(const Mesh& mesh, const SamplingOptions& options, std::uint32_t first) {
    constexpr int kSpacingRounds = 3;
    constexpr double kClose = 0.01;
    const SpacingField even(options);
    const auto wanted =
        static_cast<double>(SurfacePatches(mesh, even, kPatchSurfels, first).surfels());
    for (int i = 0; i < kSpacingRounds; ++i) {
      const double share = static_cast<double>(patches_->surfels()) / wanted;
      if (std::abs(share - 1) < kClose || !(share > 0)) return;
      map_->scale(std::sqrt(share));
      patches_.emplace(mesh, field_, kPatchSurfels, first);
    }
  }

  [[nodiscard]] std::size_t patches() const override { return patches_->size(); }

  [[nodiscard]] SampledPatch make(std::size_t index) const override {
    const SurfacePatch patch = patches_->spread(index, PatchSampler::kPointsPerSurfel);
    return {sampler_.sample(patch), patch.area};
  }

  PatchSampler sampler_;
  std::optional<SpacingMap> map_;
  SpacingField field_;
  std::optional<SurfacePatches> patches_;
};

}  // namespace

SamplingOptions with_spacing(SamplingOptions options, double area) {
  check_sampling(options);
  const bool by_count = options.spacing == 0;
  if (by_count) options.spacing = std::sqrt(area / static_cast<double>(options.count));
  // Limit the number of surfels, because memory grows with it, if slowly.
  require_request(area == 0 || std::sqrt(area) / options.spacing <= kMaxAcross,
                  by_count ? "sampling.count" : "sampling.spacing",
                  by_count ? "`sampling.count` is more than 9 * 10^10"
                           : "`sampling.spacing` is too small for a mesh of this size");
  return options;
}

void check_sampling(const SamplingOptions& options) {
  require_request(options.spacing >= 0 && std::isfinite(options.spacing), "sampling.spacing",
                  "`sampling.spacing` is negative or not finite");
  require_request(options.spacing > 0 || options.count > 0, "sampling.count",
                  "`sampling.count` is 0");
  constexpr unsigned kMaxRays = 1 << 16;
  const LightSampling& lights = options.lights;
  require_request(std::max({lights.sun_rays, lights.area_rays, lights.sky_rays}) <= kMaxRays,
                  "sampling.lights.area_rays",
                  "`sampling.lights.area_rays` or another number of rays is above 65536");
  if (!options.camera) return;
  require_request(options.pixels_per_surfel > 0 && std::isfinite(options.pixels_per_surfel),
                  "sampling.pixels_per_surfel", "`sampling.pixels_per_surfel` is not positive");
  require_request(options.finest > 0 && options.finest <= 1, "sampling.finest",
                  "`sampling.finest` is not above 0 and at most 1");
  check_camera(*options.camera, "sampling.camera");
}

double sampled_area(const Mesh& mesh, std::uint32_t first) {
  double area = 0;
  for (std::uint32_t i = first; i < mesh.triangles.size(); ++i) {
    area += sides_of(mesh, i) * whole_triangle(mesh, i).area();
  }
  return area;
}

double spacing_for(const Mesh& mesh, std::uint64_t count) {
  require_request(count > 0, "sampling.count", "`sampling.count` is 0");
  return std::sqrt(sampled_area(mesh) / static_cast<double>(count));
}

std::uint64_t sampling_bytes(std::uint64_t triangles, std::uint64_t surfels, bool adapts,
                             unsigned at_once) noexcept {
  return 24 * std::max(triangles, surfels / 1000) + (adapts ? kAdaptingBytes * surfels : 0) +
         kSampledPatchBytes * at_once;
}

std::unique_ptr<PointSource> sample_mesh(const DirectLight& light, const RayScene& scene,
                                         const SamplingOptions& options, const Executor& executor,
                                         unsigned at_once, std::uint32_t first) {
  return std::make_unique<MeshSource>(light, scene, options, executor, at_once, first);
}

double seen_area(const DirectLight& light, const RayScene& scene, const LightSampling& rays,
                 const Executor& executor) {
  const Mesh& mesh = scene.mesh();
  const double area = sampled_area(mesh);
  // Look at places where a side may be dark, or light may go through
  constexpr std::uint32_t kPlaces = 4096;
  std::vector<std::uint32_t> triangles;
  double looked_at = 0;  // area of the sides
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    if (sides_of(mesh, i) == 1 && mesh.materials[mesh.material_of[i]].is_opaque()) continue;
    triangles.push_back(i);
    looked_at += sides_of(mesh, i) * whole_triangle(mesh, i).area();
  }
  const PlacesByArea places(scene, triangles, 0);
  if (!(places.area() > 0)) return area;
  const PatchSampler sampler(scene, &light, rays, false);
  std::vector<float> seen(kPlaces);  // sides, times the opacity
  executor.for_each(kPlaces, [&](std::size_t i, unsigned) {
    const SurfaceHit at = places.place(static_cast<std::uint32_t>(i), kPlaces);
    if (at.opacity == 0) return;
    seen[i] = at.opacity;
    if (sides_of(mesh, at.triangle) == 1) return;
    // A side is looked at as often as a surfel has points; of two dark ones the front stays
    unsigned sides = 0;
    for (const bool front : {true, false}) {
      bool lit = false;
      for (unsigned k = 0; k < PatchSampler::kLitPoints && !lit; ++k)
        lit = sampler.is_seen(at, front, 8 * i + 2 * k + (front ? 1 : 0));
      sides += lit ? 1 : 0;
    }
    seen[i] *= static_cast<float>(std::max(sides, 1U));
  });
  const double sides = std::accumulate(seen.begin(), seen.end(), 0.0) / kPlaces;
  return std::max(kLeastSeen * area, area - looked_at + sides * places.area());
}

}  // namespace ptc
