// A picture of a file that shows where a verification found damage.
#pragma once

#include <filesystem>
#include <string>

#include "engine/verify/verify.h"

namespace ptc {

/// Draws the file from its first byte to its last in rows of squares, coloured by the kind of page
/// and red where it is damaged, with the first findings below.
/// @param target  the picture to write, .svg or .png
/// @param name    the name of the file, for the title
/// @throws std::system_error
void write_damage_map(const std::filesystem::path& target, const std::string& name,
                      const VerifyReport& report);

}  // namespace ptc
