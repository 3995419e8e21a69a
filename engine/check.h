// Receivers of a run that are checked against rays afterwards.
#pragma once

#include <span>
#include <vector>

#include "engine/pipeline.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Keeps every n-th receiver of a run with its shading.
class CheckSample {
 public:
  /// @param expected  receivers that will come, for the stride
  CheckSample(const CheckRequest& request, std::uint64_t expected);
  void add(std::span<const Receiver> receivers, std::span<const Shading> results);

  /// @param light  with the mesh under it, or null
  [[nodiscard]] CheckReport compare(const ContainerReader& scene, Sides sides, const Sky& sky,
                                    const DirectLight* light, const RayScene* mesh,
                                    const LightSampling& sampling, const Executor& executor) const;

 private:
  CheckRequest request_;
  std::uint64_t stride_;
  std::uint64_t seen_ = 0;
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
};

}  // namespace ptc
