// Where shaded points go: a cloud, or a container's copy with new channels.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "engine/base/surfel.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Takes shaded points in order.
class ShadedSink {
 public:
  virtual ~ShadedSink() = default;
  /// @param estimates  as many, or none where the sink was made without
  virtual void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
                     std::span<const ErrorEstimate> estimates) = 0;
  virtual void finish() = 0;
};

/// A sink for .ply or .ptcx, by the target's ending.
/// @param receivers  whose points are shaded: a container's are copied with them
/// @param points     how many will come
/// @param settings   of the shading, for the container's record
[[nodiscard]] std::unique_ptr<ShadedSink> make_shaded_sink(const std::filesystem::path& target,
                                                           const ContainerReader& receivers,
                                                           std::uint64_t points,
                                                           const std::string& settings,
                                                           bool estimates);

/// What it takes of the directory that it writes.
[[nodiscard]] std::uint64_t sink_bytes(const std::filesystem::path& target,
                                       const ContainerReader& receivers) noexcept;

}  // namespace ptc
