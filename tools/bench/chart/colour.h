// Colour spaces of vision, from linear RGB with the primaries of sRGB and white D65.
#pragma once

#include <glm/vec3.hpp>

namespace ptc {

/// Opponent colours Y Cx Cz, linear in rgb: achromatic, -16 for black to 100 for white; red-green;
/// blue-yellow. Source: Andersson et al. 2020, colour pipeline.
[[nodiscard]] glm::vec3 ycxcz_of_rgb(const glm::vec3& rgb) noexcept;

/// Inverse of ycxcz_of_rgb.
[[nodiscard]] glm::vec3 rgb_of_ycxcz(const glm::vec3& ycxcz) noexcept;

/// CIE 1976 L* a* b* with a* and b* scaled by L* / 100: colours are told apart less in the dark.
/// @param rgb  within [0, 1]
/// Source: CIE 15:2004, 8.2.1; Hunt 1952; Andersson et al. 2020, colour pipeline.
[[nodiscard]] glm::vec3 hunt_lab_of_rgb(const glm::vec3& rgb) noexcept;

/// Distance of two such: lightness and chroma apart, as holds for large differences.
/// Source: Abasi, Tehran and Fairchild 2020, "Distance metrics for very large color differences".
[[nodiscard]] float hyab(const glm::vec3& a, const glm::vec3& b) noexcept;

}  // namespace ptc
