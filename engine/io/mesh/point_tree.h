// Finds points of the plane that lie in a triangle, in a set from which points are removed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>

namespace ptc {

/// Returns twice the signed area of a triangle in the plane; it is positive when the triangle is
/// counter-clockwise.
[[nodiscard]] inline double turn(const glm::dvec2& a, const glm::dvec2& b,
                                 const glm::dvec2& c) noexcept {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Says whether p lies inside a counter-clockwise triangle or on its border, but on none of its
/// corners.
[[nodiscard]] inline bool lies_in(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c,
                                  const glm::dvec2& p) noexcept {
  if (p == a || p == b || p == c) return false;
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

/// A balanced k-d tree of points from which points are removed one by one.
///
/// Memory: about 31 bytes for each point.
class PointTree {
 public:
  /// Builds the tree.
  /// @param points  finite and all different; a point is known by its index in this vector
  explicit PointTree(const std::vector<glm::dvec2>& points);

  /// Returns a remaining point for which lies_in() is true, or nothing when there is none. A box of
  /// points is skipped only when rounding cannot make lies_in() true for any point in it, so the
  /// result is nothing only if a look at every point would find none.
  ///
  /// Among several points it returns a pseudo-random one, the same in each run. So if m points are
  /// removed in an order that does not depend on the answers, a caller that asks again whenever its
  /// answer was removed asks about log m times.
  /// @param a,b,c  corners with turn(a, b, c) > 0
  [[nodiscard]] std::optional<std::uint32_t> find_in(const glm::dvec2& a, const glm::dvec2& b,
                                                     const glm::dvec2& c);
  /// Removes the point with this index. @pre it was not removed before
  void remove(std::uint32_t point);

  /// Returns the number of boxes and points that were examined so far.
  [[nodiscard]] std::uint64_t looks() const noexcept { return looks_; }

 private:
  struct Point {
    glm::dvec2 at{0};
    std::uint32_t name = 0;  ///< index of the point in the vector that was given
  };
  struct Node {
    glm::dvec2 low{0}, high{0};  ///< corners of the box around its points
    std::uint32_t left = 0;      ///< number of remaining points; in a leaf they come first
  };
  using Range = std::pair<std::size_t, std::size_t>;  ///< indices into points_: first, end

  void build(std::size_t node, Range range);
  [[nodiscard]] bool random_bit() noexcept;

  std::vector<Point> points_;         ///< in the order of the leaves
  std::vector<std::uint32_t> place_;  ///< index of each name in points_
  std::vector<Node> nodes_;           ///< the children of node i are 2 i + 1 and 2 i + 2
  std::vector<std::pair<std::size_t, Range>> open_;  ///< stack of find_in(), kept between calls
  std::uint64_t looks_ = 0;
  std::uint64_t random_ = 0x9e3779b97f4a7c15;  ///< state of random_bit()
};

}  // namespace ptc
