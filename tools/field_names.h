// What the programs call the fields of requests.
#pragma once

#include <string>
#include <string_view>

namespace ptc {

/// The option that sets a field of a request, e.g. "--points" for "sampling.count"; empty where
/// none does.
[[nodiscard]] std::string_view option_of(std::string_view field) noexcept;

/// A message of the engine with options in place of the names of fields that stand in backquotes in
/// it. What stands in backquotes and is no field stays.
[[nodiscard]] std::string with_options(std::string_view message);

}  // namespace ptc
