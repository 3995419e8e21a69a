// Internal to the reader of EXR: the checks that the library lacks.
#pragma once

#include <cstdint>
#include <filesystem>

namespace ptc {

/// Checks the headers of an EXR file. It refuses a file whose headers ask for more memory than its
/// length can justify, or for more pixels than `max_pixels`.
/// @throws DataError, std::system_error
void check_exr_headers(const std::filesystem::path& path, std::uint64_t max_pixels);

}  // namespace ptc
