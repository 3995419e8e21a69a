// What a container stores of a point and of a node, in how many bytes, and why.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "engine/store/reader.h"

namespace ptc {

/// Facts about what is stored: "bytes_per_point" by column, measured by coding the columns of some
/// pages one by one as the file codes them; "nodes", "leaf_points"; and "simplified" as recorded.
/// @throws FormatError when a page is damaged; std::system_error
[[nodiscard]] nlohmann::ordered_json why_facts(const ContainerReader& container);

/// The lines about them.
[[nodiscard]] std::string why_text(const nlohmann::ordered_json& why);

}  // namespace ptc
