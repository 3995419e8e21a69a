// Checks some receivers of a run against rays.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/scene/mesh_reference.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// A check of some receivers against rays in the same run. Rays at the surfels keep to the memory
/// cap; rays at the mesh need no more memory than rendering it does.
struct CheckRequest {
  unsigned receivers = 0;  ///< about so many, spread over all; 0: no check
  unsigned rays = 4096;    ///< cosine-distributed, for each receiver
};

/// What a check found.
struct CheckReport {
  std::size_t receivers = 0;
  unsigned rays = 0;                      ///< for each receiver
  CheckError discs;                       ///< against rays at the same surfels
  std::optional<EstimateCheck> estimate;  ///< of the estimates, when the run made some
  std::optional<CheckError> mesh;         ///< against rays at the mesh, when there is one
  double disc_microseconds = 0;           ///< CPU time of one receiver's rays at the surfels
  double mesh_microseconds = 0;           ///< CPU time of one receiver's rays at the mesh
};

/// What the rays of a check meet besides the surfels of the scene.
struct CheckScene {
  const Sky& sky;
  const RayScene* mesh = nullptr;      ///< null: no rays at a mesh
  const DirectLight* light = nullptr;  ///< of the mesh
  LightPaths paths;                    ///< followed by rays at the mesh
};

/// Keeps an even sample of a run's receivers with their shading, the same sample each time
/// (reservoir sampling, Vitter 1985, algorithm R).
class CheckSample {
 public:
  /// @param apart  receivers that must not be chosen, because settings were chosen by them
  explicit CheckSample(const CheckRequest& request, ReceiverPlaces apart = {})
      : request_(request), apart_(std::move(apart)) {}

  /// @param estimates  one for each receiver, or none
  void add(std::span<const Receiver> receivers, std::span<const Shading> results,
           std::span<const ErrorEstimate> estimates = {});

  /// @param scene         the container that the receivers were shaded from
  /// @param memory_bytes  cap for rays at the surfels, at least StreamedRays::kMinBytes
  /// @param progress      advances by one for each receiver, twice for each reference
  [[nodiscard]] CheckReport compare(const ContainerReader& scene, Sides sides,
                                    const CheckScene& seen, std::uint64_t memory_bytes,
                                    const Executor& executor, Progress& progress) const;

 private:
  CheckRequest request_;
  ReceiverPlaces apart_;
  std::uint64_t seen_ = 0;
  std::mt19937_64 bits_;  // with its default seed
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::vector<ErrorEstimate> estimates_;
};

}  // namespace ptc
