// How a build shares its memory cap among inputs, sampling, sorts and the output.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/feed_inputs.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/resume.h"
#include "engine/sort/external_sort.h"
#include "engine/store/reader.h"

namespace ptc {

/// The settings of the sort of points, and of each of the sorts of attributes.
struct AllSortOptions {
  SortOptions points, attributes;
};

/// The number of surfels that a spacing makes of the part of a mesh that is sampled: an estimate.
/// @param spacing  scene units
[[nodiscard]] std::uint64_t expected_surfels(const LitMesh& lit, double spacing);

/// The cap of one build, and what each stage may take of it.
class BuildMemory {
 public:
  /// @param target      path of the output
  /// @param threads     of the build
  /// @param scene       container that is appended to; null: none
  /// @param resumption  of a build that can be continued; null: none
  /// All must outlive this.
  BuildMemory(const BuildRequest& request, const std::filesystem::path& target, unsigned threads,
              const ContainerReader* scene, const Resumption* resumption)
      : request_(request),
        target_(target),
        threads_(threads),
        scene_(scene),
        resumption_(resumption) {}

  /// Returns the cap less what a build takes from its beginning to its end.
  [[nodiscard]] MemoryBudget budget() const;

  /// Returns the memory for meshes. While they are read, nothing else takes any.
  [[nodiscard]] MeshLimits mesh_limits() const;

  /// Charges the inputs to a budget(), and returns what their sampling may use, but for the
  /// directories of StreamingRoom.
  /// @throws LimitError when the cap is too small for them
  [[nodiscard]] SamplingRoom charge_inputs(const BuildInputs& inputs, MemoryBudget& budget) const;

  /// Gives the sorts the memory that the cap leaves: kMinSortBytes to that of the points, and equal
  /// shares of the rest to all of them. When they are done, the directory takes their place.
  /// @param budget    already charged with the inputs
  /// @param expected  number of points that will come; 0 when it is not known
  /// @param emits     whether a point may emit light
  /// @param groups    number of sorts of attributes
  /// @throws LimitError when the cap is too small for them
  [[nodiscard]] AllSortOptions sort_options(MemoryBudget budget, std::uint64_t expected, bool emits,
                                            std::size_t groups) const;

 private:
  /// Estimates the number of pages of points and nodes. In a city there are some 5 pages of nodes
  /// for each 10 of points; 6 are assumed.
  /// @param emits   whether a point may emit light, so that fewer fit a page
  /// @param groups  of channels, each of which has a page for every page of points
  [[nodiscard]] std::uint64_t pages_of(std::uint64_t points, bool emits, std::size_t groups) const;
  /// Returns the memory for sampling that the rest of a build leaves at least.
  /// @param fixed  bytes that sampling takes in any case
  [[nodiscard]] std::uint64_t sampling_room(const MemoryBudget& budget, std::uint64_t fixed) const;

  const BuildRequest& request_;
  const std::filesystem::path& target_;
  unsigned threads_;
  const ContainerReader* scene_;
  const Resumption* resumption_;
};

}  // namespace ptc
