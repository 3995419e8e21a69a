// Colour spaces that model vision. They begin at linear RGB with the primaries of sRGB and white
// D65.
#pragma once

#include <glm/vec3.hpp>

namespace ptc {

/// Converts to opponent colours Y Cx Cz, which are linear in rgb: achromatic, from -16 for black to
/// 100 for white; red-green; blue-yellow. Source: Andersson et al. 2020, colour pipeline.
[[nodiscard]] glm::vec3 ycxcz_of_rgb(const glm::vec3& rgb) noexcept;

/// Converts opponent colours back to linear RGB; inverse of ycxcz_of_rgb().
[[nodiscard]] glm::vec3 rgb_of_ycxcz(const glm::vec3& ycxcz) noexcept;

/// Converts to CIE 1976 L* a* b* with a* and b* scaled by L* / 100: differences of colour are less
/// visible in the dark.
/// @param rgb  within [0, 1]
/// Source: CIE 15:2004, 8.2.1; Hunt 1952; Andersson et al. 2020, colour pipeline.
[[nodiscard]] glm::vec3 hunt_lab_of_rgb(const glm::vec3& rgb) noexcept;

/// The distance of two colours of hunt_lab_of_rgb(): the difference of lightness plus the distance
/// of chroma, a measure that also holds for large differences. Source: Abasi, Tehran and Fairchild
/// 2020, "Distance metrics for very large color differences".
[[nodiscard]] float hyab(const glm::vec3& a, const glm::vec3& b) noexcept;

}  // namespace ptc
