// Measures how well a container stands for another one of the same scene.
//
//   point of the exact scene   o-----> rays at its discs
//   receiver above it          o-----> rays at the discs of the other, along the same directions
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/base/executor.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Compares containers with the one that they were made of, at the same points of this one, which
/// are spread evenly over all of them.
///
/// Results depend on the containers alone.
/// Memory: within the cap of the run; between two calls some 1 MB.
class PointJudge {
 public:
  static constexpr unsigned kPlaces = 2048;  ///< points that are compared, at most
  static constexpr unsigned kRays = 512;     ///< of each of the two sets of rays of a point

  /// @param exact            must outlive this
  /// @param run, target      resources, as for roomiest_temp_dir()
  /// @param executor         must outlive this
  PointJudge(const ContainerReader& exact, const RunOptions& run,
             const std::filesystem::path& target, const Executor& executor);

  /// Returns the errors of a container. Irradiance is that of light from surfaces, as for shading.
  /// @throws LimitError, FormatError, std::system_error; DataError when the picture of the sky is
  ///         gone
  [[nodiscard]] BoundedError measure(const ContainerReader& other);

 private:
  /// Traces both sets of rays at all receivers.
  [[nodiscard]] std::vector<Shading> trace(const ContainerReader& scene) const;

  const ContainerReader& exact_;
  RunOptions run_;
  std::filesystem::path target_;
  const Executor& executor_;
  std::vector<Receiver> receivers_;
  std::vector<Shading> truth_;  ///< two for each point, side by side
};

}  // namespace ptc
