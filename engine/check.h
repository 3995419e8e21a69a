// Receivers of a run that are checked against rays afterwards.
#pragma once

#include <random>
#include <span>
#include <vector>

#include "engine/pipeline.h"
#include "engine/scene/mesh_reference.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Keeps an even sample of a run's receivers with their shading, the same each time (reservoir
/// sampling, Vitter 1985, algorithm R).
class CheckSample {
 public:
  explicit CheckSample(const CheckRequest& request) : request_(request) {}
  void add(std::span<const Receiver> receivers, std::span<const Shading> results);

  /// @param scene  as it was gathered from: with the bounces before the last in its surfels
  /// @param light  with the mesh under it, or null
  /// @param paths  what rays at the mesh follow
  /// @param progress  advances by one a receiver, once for each reference
  [[nodiscard]] CheckReport compare(const ContainerReader& scene, Sides sides, const Sky& sky,
                                    const DirectLight* light, const RayScene* mesh,
                                    const LightPaths& paths, const Executor& executor, Progress& progress) const;

 private:
  CheckRequest request_;
  std::uint64_t seen_ = 0;
  std::mt19937_64 bits_;  // its default seed
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
};

}  // namespace ptc
