// The choice of nodes for a view of a container that is read in ranges, and the requests that it
// takes: the experiment `ptcbench remote`.
#pragma once

#include <cstddef>
#include <cstdint>
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
/// are divided first. Pages are loaded in rounds, each with all pages that are known to be needed.
/// A page is needed when a node that it would divide looks more than kUnevenness times as large as
/// the smallest that was divided.
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
  };
  /// The nodes in view, as far as loaded pages divide them.
  struct Division {
    std::size_t nodes = 0;
    double least = 0;                ///< size of the smallest node that was divided
    std::vector<Candidate> waiting;  ///< not divided, for want of a page; largest first
  };

  [[nodiscard]] std::uint32_t page_of(const ChildRef& ref) const {
    return scene_.numbers().nodes()[ref.page];
  }
  [[nodiscard]] Division divide(std::size_t nodes) const;
  void add_group(const ChildRef& ref, std::vector<Candidate>& heap, std::size_t& leaves) const;
  [[nodiscard]] bool in_view(const glm::dvec3& to, double distance, double radius) const;

  PartialReader& scene_;
  ConeView view_;
};

}  // namespace ptc::bench
