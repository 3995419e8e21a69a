#include "tools/bench/experiments/remote.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "format/morton.h"

namespace ptc::bench {
namespace {

// Nodes are divided that look kCaution times as large as is expected of the smallest; after so many
// rounds, smaller ones as well.
constexpr unsigned kCautiousRounds = 12;
constexpr double kCaution = 1.6;
// A round foretells the pages of so many levels below the nodes that it divides.
constexpr int kLevelsAhead = 8;
// Radius of the sphere of a group, by the edge of its cell: what surfaces have on average.
constexpr double kSphereOfCell = 0.62;

/// Returns the edge of a cell, lattice units.
double cell_edge(int level) {
  return std::ldexp(1.0, kLatticeBits - level);
}

}  // namespace

void CountingRanges::read(std::uint64_t offset, std::span<std::byte> out) {
  source_.read(offset, out);
  ++requests_;
  bytes_ += out.size();
}

std::vector<ConeView> views_of(const Superblock& scene) {
  glm::dvec3 low, high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<glm::length_t>(axis);
    low[i] = scene.bounds_low[axis];
    high[i] = scene.bounds_high[axis];
  }
  const glm::dvec3 centre = (low + high) / 2.0, extent = high - low;
  const glm::dvec3 outside = glm::normalize(glm::dvec3(0.6, 0.5, 0.7));
  glm::dvec3 along(0);
  along[extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2] = 1;
  return {{.name = "outside",
           .eye = centre + 1.05 * glm::length(extent) * outside,
           .along = -outside,
           .half_angle = std::numbers::pi},
          {.name = "inside", .eye = centre, .along = along, .half_angle = 0.5}};
}

std::size_t ViewChoice::choose(std::size_t nodes) {
  for (unsigned round = 0;; ++round) {
    // End when there are enough nodes and none looks too large
    const Division division = divide(nodes);
    const bool enough = division.nodes >= nodes || division.waiting.empty();
    const double most = enough ? kUnevenness * division.least : 0;
    if (enough && division.largest <= most) return division.nodes;
    // Find the nodes that are too large, and what divides them
    const double size = size_of_round(division, most, round);
    std::vector<Candidate> large;
    std::set<std::uint32_t> pages;
    for (const Candidate& node : division.waiting) {
      if (node.size <= size) continue;
      large.push_back(node);
      pages.insert(page_of(node.ref));
    }
    const auto listed = [&] { return std::vector<std::uint32_t>(pages.begin(), pages.end()); };
    scene_.load_entries(listed());
    // Ask for these pages, and for what lies below them
    for (const Candidate& node : large) add_pages_below(node, size, pages);
    scene_.load(listed());
  }
}

/// Returns the size above which nodes are divided in this round: less than that of the largest one
/// that waits. It is first above what is expected, because pages that turn out to be needless cost
/// more than another round.
/// @param most  no node above this may be left
double ViewChoice::size_of_round(const Division& division, double most, unsigned round) {
  const double cautious = round <= kCautiousRounds
                              ? kCaution * division.expected
                              : division.expected * std::pow(0.9, round - kCautiousRounds);
  for (const double size : {cautious, division.expected}) {
    if (std::max(size, most) < division.largest) return std::max(size, most);
  }
  return most > 0 ? most : std::nextafter(division.largest, 0.0);
}

/// Divides the largest node, again and again, and sets those aside whose groups are not loaded.
ViewChoice::Division ViewChoice::divide(std::size_t nodes) const {
  const Superblock& s = scene_.superblock();
  std::vector<Candidate> heap{
      {1,
       {.interior = true, .page = s.root_page, .slot = static_cast<std::uint16_t>(s.root_slot)}}};
  std::size_t leaves = 0;
  double squares = 0;  // of the sizes of the nodes that wait
  Division out;
  const auto count = [&] { return heap.size() + leaves + out.waiting.size(); };
  // The size t at which the nodes that wait, counted as (size / t)^2 each, make up for those that
  // lack; at least the size of the next node.
  const auto expected = [&] {
    const std::size_t others = heap.size() + leaves;
    const double next = heap.empty() ? 0 : heap.front().size;
    return nodes > others ? std::max(next, std::sqrt(squares / static_cast<double>(nodes - others)))
                          : next;
  };
  while (!heap.empty() && count() < nodes) {
    if (out.expected == 0 && expected() > heap.front().size) out.expected = expected();
    std::ranges::pop_heap(heap, {}, &Candidate::size);
    const Candidate largest = heap.back();
    heap.pop_back();
    if (scene_.has(page_of(largest.ref))) {
      out.least = largest.size;
      add_group(largest.ref, heap, leaves);
    } else {
      out.waiting.push_back(largest);
      out.largest = std::max(out.largest, largest.size);
      squares += largest.size * largest.size;
    }
  }
  if (out.expected == 0) out.expected = expected();
  out.nodes = count();
  return out;
}

/// Adds the nodes of a group that are in view.
/// @param leaves  is raised by the number of those that no group divides
void ViewChoice::add_group(const ChildRef& ref, std::vector<Candidate>& heap,
                           std::size_t& leaves) const {
  for (const NodeChild& child : scene_.nodes(ref.page).decode(ref.slot).children) {
    const glm::dvec3 to = from_eye(child.node.mean);
    const double radius = child.node.radius * scene_.header().frame.unit();
    const double distance = glm::length(to);
    if (!in_view(to, distance, radius)) continue;
    if (!child.ref.interior) {
      ++leaves;
      continue;
    }
    heap.push_back(
        {radius / std::max(distance, radius), child.ref, child.node.mean, child.node.radius});
    std::ranges::push_heap(heap, {}, &Candidate::size);
  }
}

/// Adds the pages that divide what is below a node, until nothing looks larger than `size`.
/// @pre the entry of the page that divides the node is known
void ViewChoice::add_pages_below(const Candidate& node, double size,
                                 std::set<std::uint32_t>& pages) const {
  Cell cell{.level = std::min(scene_.level(page_of(node.ref)), kHalfBits)};
  const double edge = cell_edge(cell.level);
  for (std::size_t axis = 0; axis < 3; ++axis)
    cell.low[axis] = std::floor(node.mean[axis] / edge) * edge;
  add_pages_in(cell, node, size, kLevelsAhead, pages);
}

/// Adds the pages of the groups of the cells in a cell that look larger than `size`, are in view
/// and touch the node's sphere.
/// @param levels  number of levels to go down
void ViewChoice::add_pages_in(const Cell& cell, const Candidate& node, double size, int levels,
                              std::set<std::uint32_t>& pages) const {
  if (levels == 0 || cell.level >= kHalfBits) return;
  const int level = cell.level + 1;
  const double edge = cell_edge(level), radius = kSphereOfCell * edge;
  const double unit = scene_.header().frame.unit();
  for (unsigned octant = 0; octant < 8; ++octant) {
    Cell child{.low = cell.low, .level = level};
    std::array<double, 3> middle{};
    double squares = 0;  // of the distance from the node's mean, lattice units
    for (std::size_t axis = 0; axis < 3; ++axis) {
      child.low[axis] += (octant >> axis & 1) != 0 ? edge : 0;
      middle[axis] = child.low[axis] + edge / 2;
      squares += (middle[axis] - node.mean[axis]) * (middle[axis] - node.mean[axis]);
    }
    const glm::dvec3 to = from_eye(middle);
    const double distance = glm::length(to);
    if (squares > (node.radius + radius) * (node.radius + radius) ||
        radius * unit <= size * distance || !in_view(to, distance, radius * unit))
      continue;
    const LatticePoint corner{static_cast<std::uint64_t>(child.low[0]),
                              static_cast<std::uint64_t>(child.low[1]),
                              static_cast<std::uint64_t>(child.low[2])};
    if (const auto page = scene_.known_node_page(level, encode_morton(corner).high))
      pages.insert(*page);
    add_pages_in(child, node, size, levels - 1, pages);
  }
}

/// Returns the way from the eye to a place, scene units.
/// @param at  lattice units
glm::dvec3 ViewChoice::from_eye(const std::array<double, 3>& at) const {
  const Frame& frame = scene_.header().frame;
  const auto along = [&](std::size_t axis) { return frame.origin[axis] + at[axis] * frame.unit(); };
  return glm::dvec3(along(0), along(1), along(2)) - view_.eye;
}

/// Says whether a sphere reaches into the view.
/// @param to  from the eye to its centre
bool ViewChoice::in_view(const glm::dvec3& to, double distance, double radius) const {
  if (distance <= radius) return true;
  const double angle = std::acos(std::clamp(glm::dot(to, view_.along) / distance, -1.0, 1.0));
  return angle - std::asin(radius / distance) <= view_.half_angle;
}

}  // namespace ptc::bench
