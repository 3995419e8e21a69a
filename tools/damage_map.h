// A picture of what a verification found in a file.
#pragma once

#include <filesystem>
#include <string>

#include "engine/verify/verify.h"

namespace ptc {

/// Draws the file from its first byte to its last, row by row, each cell the kind of what lies
/// there, red where it is damaged, and the first findings under it.
/// @param target  .svg or .png
/// @param name    of the file
void write_damage_map(const std::filesystem::path& target, const std::string& name,
                      const VerifyReport& report);

}  // namespace ptc
