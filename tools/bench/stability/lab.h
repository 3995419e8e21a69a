// What the rows of the stability table are made with: scenes, receivers on grids, and the truth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"
#include "engine/shade/shader.h"
#include "engine/store/reader.h"

namespace ptc::bench {

inline constexpr unsigned kReceiversAlong = 32;  ///< receivers along the side of a square of them
inline constexpr unsigned kMovingFrames = 100;   ///< frames of what moves
inline constexpr double kAllowedStep = 0.005;    ///< of white, beyond one and a half of a true step

/// Where rows are measured.
struct Lab {
  std::filesystem::path work;  ///< directory for containers, which have no name there once open
  const Executor& executor;
};

/// The radiance that arrives from a direction (unit) where nothing covers it.
using SkyLight = std::function<glm::vec3(const glm::vec3&)>;

/// A sky of radiance 1 everywhere.
[[nodiscard]] glm::vec3 white_sky(const glm::vec3& direction);

/// A container that is shaded as the programs do by default.
class SmallScene {
 public:
  /// Builds a scene of surfels as they are.
  SmallScene(const Lab& lab, std::span<const Surfel> surfels);
  /// Samples and lights a mesh. @param points  surfels wanted
  SmallScene(const Lab& lab, const Mesh& mesh, const LightRig& lights, std::uint64_t points);

  [[nodiscard]] const ContainerReader& container() const noexcept { return *container_; }
  /// Returns all surfels, in the container's order.
  [[nodiscard]] std::vector<Surfel> surfels() const;
  /// Returns the bytes of the container's file.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  /// Returns the mean radius of the surfels, scene units.
  [[nodiscard]] double radius() const;
  /// Shades receivers. Options that are not given are those of the programs.
  [[nodiscard]] std::vector<Shading> shade(std::span<const Receiver> receivers,
                                           const SkyLight& sky = {},
                                           const GatherOptions& gather = {}) const;
  /// Traces rays at the discs from receivers.
  /// @param rays  for each receiver, best a power of 4
  [[nodiscard]] std::vector<Shading> trace(std::span<const Receiver> receivers, unsigned rays,
                                           const SkyLight& sky = {}) const;

 private:
  /// Opens the container that was written.
  void open(const std::filesystem::path& path);

  const Lab& lab_;
  std::uint64_t bytes_ = 0;
  std::unique_ptr<ContainerReader> container_;
};

/// Traces rays at a mesh from receivers: light of one bounce, and the sky.
/// @param lights  whose sky is constant
/// @param rays    for each receiver, best a power of 4
[[nodiscard]] std::vector<Shading> trace_at_mesh(const Lab& lab, const Mesh& mesh,
                                                 const LightRig& lights,
                                                 std::span<const Receiver> receivers,
                                                 unsigned rays);

/// Makes receivers on a grid, row by row.
/// @param place  takes shares of the width and of the height, both in (0, 1)
[[nodiscard]] std::vector<Receiver> receivers_on_grid(
    unsigned width, unsigned height, const std::function<Receiver(double, double)>& place);

/// Returns what is not covered, as grey.
[[nodiscard]] glm::vec3 openness(const Shading& shading);
/// Returns the light of surfaces and sky over pi: 1 where a radiance of 1 comes from everywhere.
[[nodiscard]] glm::vec3 brightness(const Shading& shading);
/// Returns a value of each shading.
[[nodiscard]] std::vector<glm::vec3> values(std::span<const Shading> shadings,
                                            glm::vec3 (*value)(const Shading&));
/// Returns the same grey value so many times.
[[nodiscard]] std::vector<glm::vec3> grey(std::size_t count, double value);

/// Returns the greatest difference of two lists in any channel.
[[nodiscard]] double largest_difference(std::span<const glm::vec3> a, std::span<const glm::vec3> b);
/// Returns the root mean square of the differences in all channels.
[[nodiscard]] double rms_difference(std::span<const glm::vec3> a, std::span<const glm::vec3> b);
/// Returns rms_difference() over the mean of the true values.
[[nodiscard]] double relative_rms(std::span<const glm::vec3> ours,
                                  std::span<const glm::vec3> truth);
/// Returns the mean of all channels.
[[nodiscard]] double mean_value(std::span<const glm::vec3> values);

}  // namespace ptc::bench
