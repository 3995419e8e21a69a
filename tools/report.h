// Engine statistics as JSON facts and as words.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "engine/ptc.h"

namespace ptc {

/// format_version, points, nodes, node_groups, levels, bounds, pages, page_size, bytes of the file.
[[nodiscard]] nlohmann::ordered_json container_facts(const Superblock& superblock);
[[nodiscard]] nlohmann::ordered_json facts_of(const BuildSpace& space);
[[nodiscard]] nlohmann::ordered_json facts_of(const SortStatistics& sort);
[[nodiscard]] nlohmann::ordered_json facts_of(const CacheStatistics& cache);
[[nodiscard]] nlohmann::ordered_json facts_of(const GatherCounts& counts);
[[nodiscard]] nlohmann::ordered_json facts_of(const StageSeconds& seconds);
[[nodiscard]] nlohmann::ordered_json facts_of(const CheckReport& check);
[[nodiscard]] nlohmann::ordered_json facts_of(const LightingReport& report);

/// "lit.ply: 1000 receivers, 1.20 s, 99.1 % cache hits", the stages, and the check if there was
/// one.
[[nodiscard]] std::string shade_text(const std::string& output, const LightingReport& report);
/// Sum over all stages.
[[nodiscard]] double total_seconds(const StageSeconds& seconds);
/// "1.23 MB", powers of 1000.
[[nodiscard]] std::string bytes_text(std::uint64_t bytes);
/// "  read 1.2 s, sort 3.4 s": the stages in their order.
[[nodiscard]] std::string stages_text(const StageSeconds& seconds);

}  // namespace ptc
