// Pictures that are drawn once and written as SVG or PNG.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tools/bench/chart/canvas.h"

namespace ptc {

struct Picture {
  double width = 0;  ///< units, at most 16000, as is the height
  double height = 0;
  std::string title;  ///< of the SVG, where text is drawn as outlines: this and what follows can be
                      ///< searched
  std::string description;
  std::function<void(Canvas&)> draw;
};

/// Writes a picture by the ending of the target's name, in equal bytes for equal pictures, fonts
/// and versions of cairo. A PNG has two pixels for each unit. Published whole or not at all.
/// @throws std::system_error; std::invalid_argument when the ending is neither .svg nor .png, a
/// text is no UTF-8, or
///         the picture is larger than 16000 units
void write_picture(const std::filesystem::path& target, const Picture& picture);

}  // namespace ptc
