// Pictures that are drawn once and written as SVG or PNG.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tools/bench/chart/canvas.h"

namespace ptc {

/// What is drawn, and its size.
struct Picture {
  double width = 0;         ///< units, at most 16000
  double height = 0;        ///< units, at most 16000
  std::string title;        ///< <title> of the SVG, which a search finds: drawn text is outlines
  std::string description;  ///< <desc> of the SVG, for the same purpose
  std::function<void(Canvas&)> draw;
};

/// Writes a picture as SVG or PNG, by the ending of the target's name. Equal pictures, fonts and
/// versions of cairo give equal bytes. A PNG has two pixels for each unit. The file is published
/// whole or not at all.
/// @throws std::system_error; std::invalid_argument when the ending is neither .svg nor .png, a
///         text is not UTF-8, or the picture is larger than 16000 units
void write_picture(const std::filesystem::path& target, const Picture& picture);

}  // namespace ptc
