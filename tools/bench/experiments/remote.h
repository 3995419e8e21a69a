// The choice of nodes for a view of a container that is read in ranges, and the requests that it
// takes: the experiment `ptcbench remote`.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include "engine/store/partial_reader.h"

namespace ptc::bench {

/// A source of ranges that counts what is asked of it.
class CountingRanges : public RangeSource {
 public:
  /// @param source  must outlive this
  explicit CountingRanges(RangeSource& source) : source_(source) {}
  [[nodiscard]] std::string name() const override { return source_.name(); }
  [[nodiscard]] std::uint64_t size() const override { return source_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> out) override;

  /// Returns the number of requests so far.
  [[nodiscard]] std::uint64_t requests() const noexcept { return requests_; }
  /// Returns the number of bytes that they asked for.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }

 private:
  RangeSource& source_;
  std::uint64_t requests_ = 0, bytes_ = 0;
};

/// What an eye sees: all directions within an angle about one direction.
struct ConeView {
  std::string name;
  glm::dvec3 eye{0};           ///< scene units
  glm::dvec3 along{1, 0, 0};   ///< unit vector
  double half_angle = 3.1416;  ///< radians; pi or more: every direction
};

/// Returns a view of the whole scene from 1.05 diagonals of its bounds beside their centre, and a
/// view from within, along the longest axis. Only the latter leaves out what lies behind the eye.
/// @param scene  of a scene that has points
[[nodiscard]] std::vector<ConeView> views_of(const Superblock& scene);

/// Chooses the nodes that show a scene in a view: those that look largest, as radius over distance,
/// are divided first. It is done when no node that waits for a page looks more than kUnevenness
/// times as large as the smallest that was divided.
///
/// Pages are loaded in rounds. A round asks for all that the view needs as far as can be foretold
/// from what is loaded. How small the smallest node will be is estimated from the nodes that wait:
/// n nodes of a surface become n k^2 when each looks a k-th as large. Which pages lie deeper is
/// foretold from the levels and first keys of the known entries.
class ViewChoice {
 public:
  static constexpr double kUnevenness = 1.4;

  /// @param scene  must outlive this
  ViewChoice(PartialReader& scene, const ConeView& view) : scene_(scene), view_(view) {}

  /// Loads what the choice takes, beyond what is loaded already.
  /// @param nodes  1 or more
  /// @return the number of nodes chosen: `nodes` or up to 7 more, or all nodes in view
  std::size_t choose(std::size_t nodes);

 private:
  /// A node that the group it refers to can divide.
  struct Candidate {
    double size;  ///< radius over distance
    ChildRef ref;
    std::array<double, 3> mean{};  ///< lattice units
    double radius = 0;             ///< lattice units
  };
  /// The nodes in view, as far as loaded pages divide them.
  struct Division {
    std::size_t nodes = 0;
    double least = 0;                ///< size of the smallest node that was divided
    double expected = 0;             ///< about what `least` would be if all pages were loaded
    double largest = 0;              ///< size of the largest node that waits
    std::vector<Candidate> waiting;  ///< not divided, for want of a page
  };
  /// A cell of the octree.
  struct Cell {
    std::array<double, 3> low{};  ///< low corner, lattice units
    int level = 0;
  };

  [[nodiscard]] std::uint32_t page_of(const ChildRef& ref) const {
    return scene_.numbers().nodes()[ref.page];
  }
  [[nodiscard]] Division divide(std::size_t nodes) const;
  void add_group(const ChildRef& ref, std::vector<Candidate>& heap, std::size_t& leaves) const;
  [[nodiscard]] static double size_of_round(const Division& division, double most, unsigned round);
  void add_pages_below(const Candidate& node, double size, std::set<std::uint32_t>& pages) const;
  void add_pages_in(const Cell& cell, const Candidate& node, double size, int levels,
                    std::set<std::uint32_t>& pages) const;
  [[nodiscard]] glm::dvec3 from_eye(const std::array<double, 3>& at) const;
  [[nodiscard]] bool in_view(const glm::dvec3& to, double distance, double radius) const;

  PartialReader& scene_;
  ConeView view_;
};

}  // namespace ptc::bench
