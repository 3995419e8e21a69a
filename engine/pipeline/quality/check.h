// Compares a sample of a run's receivers with rays.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/mesh_reference.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"
#include "engine/trace/ray_shader.h"

namespace ptc {

/// A check of a run: some of its receivers are compared with rays.
///
/// Rays at the surfels show the error of the gather alone; rays at the mesh, where there is one,
/// that of the surfels too. Rays at the surfels keep to the memory cap; rays at the mesh need no
/// more memory than rendering it does.
struct CheckRequest {
  unsigned receivers = 0;  ///< maximum of receivers to compare, spread over all; 0: no check
  unsigned rays = 4096;    ///< cosine-distributed rays for each receiver, 1 or more
};

/// The errors that a check found, and the time that it took.
struct CheckReport {
  std::size_t receivers = 0;              ///< number of receivers that were compared
  unsigned rays = 0;                      ///< rays for each receiver
  CheckError discs;                       ///< errors against rays at the same surfels
  std::optional<EstimateCheck> estimate;  ///< quality of the estimates, when the run made some
  /// Errors of reflections against more rays at the surfels, when the run made some. The members of
  /// irradiance are about radiance, W / (m^2 sr).
  std::optional<CheckError> reflection;
  std::optional<CheckError> mesh;  ///< errors against rays at the mesh, when there is one
  double disc_microseconds = 0;    ///< CPU time of one receiver's rays at the surfels
  double mesh_microseconds = 0;    ///< CPU time of one receiver's rays at the mesh
};

/// The mesh that the rays of a check meet, besides the surfels of the scene, and its light.
struct CheckScene {
  const RayScene* mesh = nullptr;      ///< mesh of the picture; null: no rays at a mesh
  const DirectLight* light = nullptr;  ///< direct light at the mesh
  LightPaths paths;                    ///< paths of the light that rays at the mesh follow
};

/// The results for a block of receivers. The spans belong to a Lighting.
struct LitReceivers {
  std::span<const Shading> shading;
  std::span<const ErrorEstimate> estimates;  ///< empty when no estimates were asked for
  std::span<const Reflection> reflections;   ///< empty when none were asked for
  /// Shadows of each receiver in every group that was asked for, receiver after receiver.
  std::span<const float> shadows;
};

/// An even sample of a run's receivers with their shading. The same receivers in the same order
/// give the same sample (reservoir sampling, Vitter 1985, algorithm R).
class CheckSample {
 public:
  /// @param apart  receivers that must not be in the sample, because the settings were chosen by
  ///               their errors
  explicit CheckSample(const CheckRequest& request, ReceiverPlaces apart = {})
      : request_(request), apart_(std::move(apart)) {}

  /// Offers shaded receivers to the sample.
  void add(std::span<const Receiver> receivers, const LitReceivers& lit);

  /// Traces rays at the sampled receivers and compares.
  /// @param scene     the container that the receivers were shaded from
  /// @param options   of the rays at the surfels
  /// @param mirrors   as they were for reflections, if the sample has any
  /// @param progress  advances by one for each half of a receiver's reference: by two for each
  ///                  receiver at the surfels, and by two more at the mesh
  [[nodiscard]] CheckReport compare(const ContainerReader& scene, const RayOptions& options,
                                    const Mirrors& mirrors, const CheckScene& seen,
                                    const Executor& executor, Progress& progress) const;

 private:
  CheckRequest request_;
  ReceiverPlaces apart_;
  std::uint64_t seen_ = 0;
  std::mt19937_64 bits_;  // with its default seed, so that the sample is the same each time
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::vector<ErrorEstimate> estimates_;
  std::vector<Reflection> reflections_;
};

}  // namespace ptc
