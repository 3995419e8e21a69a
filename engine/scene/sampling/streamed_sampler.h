// Samples meshes that do not fit in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/piece_file.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/surface_survey.h"

namespace ptc {

/// The memory and the directories of streaming.
struct StreamingRoom {
  /// The least memory: that of one patch.
  static constexpr std::uint64_t kLeastBytes = std::uint64_t{26} << 20;
  std::uint64_t memory_bytes = 8 * kLeastBytes;       ///< at least kLeastBytes
  std::vector<std::filesystem::path> temp_dirs{"."};  ///< at least one
};

/// Makes a stream of surfels of the meshes that stand in one place, as sample_mesh() does, but
/// without light: they reflect nothing yet, and none counts as buried.
///
/// Patches are smaller than those of sample_mesh(), so that the surfels are others, though as many
/// and as even. They do not depend on the memory, the threads or the directories.
/// @param parts, executor  must outlive the source
/// @param found            survey() of the parts
/// @param options          its lights do not matter
/// @param room             for the sort and the patches
/// @throws RequestError as sample_mesh(); std::system_error
[[nodiscard]] std::unique_ptr<PointSource> sample_parts(const MeshParts& parts,
                                                        const SurfaceSurvey& found,
                                                        const SamplingOptions& options,
                                                        const StreamingRoom& room,
                                                        const Executor& executor);

/// Returns the bytes that this and sample_placed() take in addition to MeshParts::bytes() and the
/// room.
/// @param options  with_spacing()
[[nodiscard]] std::uint64_t streaming_bytes(const SurfaceSurvey& found,
                                            const SamplingOptions& options) noexcept;

}  // namespace ptc
