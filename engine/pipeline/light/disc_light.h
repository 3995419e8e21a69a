// The light that reaches the points of a container straight from suns, lamps and emitters, by
// shadow rays at its discs (spec/shading.md#relighting).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/cache/page_cache.h"
#include "engine/scene/light/light_rays.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"
#include "engine/trace/shadow_tracer.h"

namespace ptc {

/// Lights surfels by shadow rays.
///
/// Four places of a surfel's square cell are lit, and share its rays: so the border of a shadow is
/// as wide as the surfels along it are.
///
///     +-------+
///     | o | o |     Each place rises off the surfel as a receiver does.
///     |---+---|
///     | o | o |
///     +-------+
///
/// A receiver has one place, where it is. Results depend on the surfels, their numbers and the rays
/// alone.
/// Memory: thread_bytes() for each thread.
class DiscLight {
 public:
  /// Places of a surfel's cell that are lit.
  static constexpr unsigned kCellPlaces = 4;
  /// Surfels that one thread lights together, at least.
  static constexpr std::size_t kBlock = 4096;
  /// Returns the bytes of memory for each thread.
  [[nodiscard]] static std::uint64_t thread_bytes(const LightRig& rig,
                                                  const LightSampling& sampling,
                                                  unsigned places) noexcept;

  /// @param view, cache  must outlive this; of the same container
  /// @param rays         must outlive this
  /// @param sampling     rays of each surfel; sky_rays is not used
  /// @param places       of a surfel that are lit: kCellPlaces, or 1 for receivers
  DiscLight(const SceneView& view, PageCache& cache, const LightRays& rays,
            const LightSampling& sampling, unsigned places, Sides sides, const Executor& executor);
  ~DiscLight();

  /// Returns the irradiance of surfels, W/m^2.
  /// @param surfels  neighbours side by side
  /// @param heights  for each surfel: how far its receivers rise above it, scene units
  /// @param first    number of the first surfel, which with the others fixes the sample points
  /// @param out      for each surfel
  /// @param open     for each surfel: what would arrive if nothing hid it; may be empty
  /// @throws FormatError when a page is damaged; std::system_error
  void irradiance(std::span<const Surfel> surfels, std::span<const float> heights,
                  std::uint64_t first, std::span<glm::vec3> out, std::span<glm::vec3> open = {});

  /// Number of shadow rays so far.
  [[nodiscard]] std::uint64_t rays() const noexcept;

 private:
  struct Worker;

  void light_block(Worker& worker, std::span<const Surfel> surfels, std::span<const float> heights,
                   std::uint64_t first, std::span<glm::vec3> out, std::span<glm::vec3> open) const;

  const SceneView& view_;
  PageCache& cache_;
  const LightRays& rays_;
  unsigned places_;
  LightSampling sampling_;  ///< of each place
  Sides sides_;
  const Executor& executor_;
  std::vector<std::unique_ptr<Worker>> workers_;  ///< by thread, made when first needed
};

/// Memory of an emitting triangle: as it is collected, and in LightRays.
inline constexpr std::uint64_t kEmitterBytes = 160;

/// The surfels of a container that emit.
struct Emitting {
  std::uint64_t count = 0;  ///< number of surfels
  double area = 0;          ///< of them, scene units squared
};
/// Counts the surfels of a container that emit.
/// @throws FormatError when a page is damaged; std::system_error
[[nodiscard]] Emitting count_emitting(const ContainerReader& container);

/// Returns rays to the lights of a rig and to the emitting surfels of a container. Each of these is
/// two triangles for its square cell, at the height of a receiver or above, so that rays which end
/// there do not meet the surfel itself.
/// @param rig    normalised()
/// @param lift   height over the radius of a surfel, for receivers; less than usual is not taken
/// @param count  Emitting::count; 0: there are no rays to surfels
/// @throws FormatError when a page is damaged; std::system_error
/// Memory: 2 kEmitterBytes for each emitting surfel.
[[nodiscard]] LightRays rays_at_lights(const ContainerReader& container, const LightRig& rig,
                                       float lift, std::uint64_t count);

}  // namespace ptc
