// Statistics of the engine as JSON facts for --json, and as lines of a summary.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "engine/ptc.h"
#include "tools/common.h"

namespace ptc {

/// The facts that every program states of a container: format_version, points, nodes, node_groups,
/// levels, bounds in scene units, pages, page_size in bytes, bytes.file.
[[nodiscard]] nlohmann::ordered_json container_facts(const Superblock& superblock);
/// The room that a build needs and has, in bytes, for temporary files and for the output.
[[nodiscard]] nlohmann::ordered_json facts_of(const BuildSpace& space);
/// The settings that were chosen, and the error that they have.
[[nodiscard]] nlohmann::ordered_json facts_of(const TuningReport& tuning);
/// Points, buckets and spilled bytes of an external sort.
[[nodiscard]] nlohmann::ordered_json facts_of(const SortStatistics& sort);
/// Lookups, hits, evictions, bytes read, frames and waiting time of a page cache.
[[nodiscard]] nlohmann::ordered_json facts_of(const CacheStatistics& cache);
/// Receivers, and the nodes and surfels that a gather tested and drew for them.
[[nodiscard]] nlohmann::ordered_json facts_of(const GatherCounts& counts);
/// Seconds of each stage by its name, and their total.
[[nodiscard]] nlohmann::ordered_json facts_of(const StageSeconds& seconds);
/// Errors against rays at the surfels ("discs") and, where there is one, at the mesh.
[[nodiscard]] nlohmann::ordered_json facts_of(const CheckReport& check);
/// All facts of a shading or rendering, with those of its tuning, check and damage if there are
/// any.
[[nodiscard]] nlohmann::ordered_json facts_of(const LightingReport& report);
/// All facts of a lighting.
[[nodiscard]] nlohmann::ordered_json facts_of(const LightReport& report);
/// The number of surfels that was chosen, its error, and all trials.
[[nodiscard]] nlohmann::ordered_json facts_of(const SurfelChoice& choice);
/// What a simplification leaves, its errors, and all trials.
[[nodiscard]] nlohmann::ordered_json facts_of(const SimplificationChoice& choice);

/// The line about settings that were chosen.
[[nodiscard]] std::string tuning_text(const TuningReport& tuning);
/// The line about a number of surfels that was chosen.
[[nodiscard]] std::string choice_text(const SurfelChoice& choice);
/// The lines about a simplification that was chosen.
[[nodiscard]] std::string choice_text(const SimplificationChoice& choice);
/// The summary of a lighting: "lit.ptcx: 1000 points, 4000 shadow rays, 1.20 s", the stages, and a
/// line on what emits light.
[[nodiscard]] std::string light_text(const std::string& output, const LightReport& report);
/// The summary of a shading or rendering: "lit.ply: 1000 receivers, 1.20 s, 99.10 % cache hits",
/// the stages, and a line each for damage, tuning and check if there are any.
[[nodiscard]] std::string shade_text(const std::string& output, const LightingReport& report);
/// Seconds of all stages together.
[[nodiscard]] double total_seconds(const StageSeconds& seconds);
/// A number of bytes in powers of 1000: "1.23 MB".
[[nodiscard]] std::string bytes_text(std::uint64_t bytes);
/// A line of the stages in their order, "  read 1.20 s, sort 3.40 s"; empty without stages.
[[nodiscard]] std::string stages_text(const StageSeconds& seconds);

/// Renders pictures, or bakes textures, and reports them.
/// @param layers  pictures of single layers, beside the outputs
[[nodiscard]] Outcome render_files(const RenderRequest& request,
                                   const std::vector<std::filesystem::path>& outputs,
                                   const std::vector<PictureTarget>& layers, Progress& progress);

}  // namespace ptc
