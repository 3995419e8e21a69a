// Options of ptcbench that several of its commands take.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/ptc.h"

namespace ptc::bench {

/// "SR,RAD,R[,X]": solid angle, parallax, resolution, inflation. Refuses what a gather does not
/// take.
[[nodiscard]] GatherOptions parse_setting(const std::string& text);

/// Some of the words in `chosen`, repeatable. They must stay where they are.
CLI::Option* add_words(CLI::App& command, const char* name, std::vector<std::string>& chosen,
                       const char* description);

/// --points, repeatable; sorted.
void add_points_list(CLI::App& command, std::vector<std::uint64_t>& points,
                     const char* description);

}  // namespace ptc::bench
