// The options that set the fields of requests.
#pragma once

#include <string>
#include <string_view>

namespace ptc {

/// The option that sets a field of a request, such as "--points" for "sampling.count"; empty when
/// no option does.
[[nodiscard]] std::string_view option_of(std::string_view field) noexcept;

/// A message of the engine in which options replace the names of fields that stand in backquotes.
/// Any other text in backquotes stays as it is.
[[nodiscard]] std::string with_options(std::string_view message);

}  // namespace ptc
