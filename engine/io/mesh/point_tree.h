// Which of many points of the plane lie in a triangle.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>

namespace ptc {

/// Twice the signed area of a triangle in the plane: positive when it is counter-clockwise.
[[nodiscard]] inline double turn(const glm::dvec2& a, const glm::dvec2& b,
                                 const glm::dvec2& c) noexcept {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Whether p is none of the corners of a counter-clockwise triangle and not outside of it.
[[nodiscard]] inline bool lies_in(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c,
                                  const glm::dvec2& p) noexcept {
  if (p == a || p == b || p == c) return false;
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

/// Points in a balanced k-d tree, from which they are taken one by one.
///
/// Memory: 24 bytes a point.
class PointTree {
 public:
  /// @param points  finite and different; known by their places in this vector
  explicit PointTree(const std::vector<glm::dvec2>& points);

  /// A point that is left and of which lies_in() is true. Boxes of points are passed over only
  /// where rounding cannot make that true of any point in them, so that one is found whenever a
  /// look at every point would find one.
  ///
  /// Of several points it is one at random, the same in each run: of m points that are removed in
  /// an order that does not depend on the answers, about log m are found one after another.
  /// @param a,b,c  with turn(a, b, c) > 0
  [[nodiscard]] std::optional<std::uint32_t> find_in(const glm::dvec2& a, const glm::dvec2& b,
                                                     const glm::dvec2& c);
  void remove(std::uint32_t point);

  /// Boxes and points that were looked at so far.
  [[nodiscard]] std::uint64_t looks() const noexcept { return looks_; }

 private:
  struct Point {
    glm::dvec2 at{0};
    std::uint32_t name = 0;  ///< its place in the vector that was given
  };
  struct Node {
    glm::dvec2 low{0}, high{0};
    std::uint32_t left = 0;  ///< points that were not removed; in a leaf they are the first ones
  };
  using Range = std::pair<std::size_t, std::size_t>;  ///< of points_

  void build(std::size_t node, Range range);
  [[nodiscard]] bool random_bit() noexcept;

  std::vector<Point> points_;         ///< in the order of the leaves
  std::vector<std::uint32_t> place_;  ///< of each name in points_
  std::vector<Node> nodes_;           ///< the children of node i are 2 i + 1 and 2 i + 2
  std::vector<std::pair<std::size_t, Range>> open_;
  std::uint64_t looks_ = 0;
  std::uint64_t random_ = 0x9e3779b97f4a7c15;
};

}  // namespace ptc
