// Sheets of pictures beside what they should show.
#pragma once

#include <vector>

#include "engine/io/image/image.h"

namespace ptc::bench {

/// The visible difference that flip_map() shows as white.
inline constexpr float kFlipWhite = 0.25F;

/// Returns visible differences as colours from black over red and yellow to white, linear RGB.
/// @param errors  width x height values of flip() or hdr_flip()
[[nodiscard]] Image flip_map(const std::vector<float>& errors, unsigned width, unsigned height);

/// Returns pictures of one size side by side on white.
/// @param images  one or more
[[nodiscard]] Image side_by_side(const std::vector<Image>& images);

/// Returns pictures of any size below and beside one another on grey, in columns of about equal
/// height.
/// @param zoom  pixels along the side of each pixel of the pictures, 1 or more
[[nodiscard]] Image in_columns(const std::vector<Image>& images, unsigned columns, unsigned zoom);

}  // namespace ptc::bench
