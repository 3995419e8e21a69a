// A node page's payload: sibling groups of the octree (spec/nodes.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "format/morton.h"
#include "format/node_layout.h"

namespace ptc {

inline constexpr int kMaxChildren = 8;
/// Cells of coincident points are split by rank below the lattice: levels 43 to 62.
inline constexpr int kMaxLevel = 62;
inline constexpr std::uint32_t kMaxLeafPoints = 0xffff;

/// Where a node's children are: a sibling group or a run of points.
struct ChildRef {
  bool interior = false;
  std::uint32_t page = 0;         ///< interior: node page
  std::uint16_t slot = 0;         ///< interior: group in that page
  std::uint64_t first_point = 0;  ///< leaf: index in Morton order, below 2^48
  std::uint32_t point_count = 0;  ///< leaf: 1 to kMaxLeafPoints
  friend bool operator==(const ChildRef&, const ChildRef&) = default;
};

/// A child reference as it lies in a group: interior page | slot << 32, leaf first point | count
/// << 48.
[[nodiscard]] constexpr ChildRef decode_reference(std::uint64_t word, bool interior) noexcept {
  ChildRef ref;
  ref.interior = interior;
  if (interior) {
    ref.page = static_cast<std::uint32_t>(word);
    ref.slot = static_cast<std::uint16_t>(word >> 32);
  } else {
    ref.first_point = word & ((std::uint64_t{1} << 48) - 1);
    ref.point_count = static_cast<std::uint32_t>(word >> 48);
  }
  return ref;
}

/// What shading knows of a cluster of surfels, before it is quantised.
struct NodeSummary {
  std::array<double, 3> mean{};  ///< area-weighted mean position, in lattice units
  double radius = 0;             ///< of a sphere about the mean that holds all discs, lattice units
  double area = 0;               ///< sum of 2 r^2, in scene units squared
  /// All discs lie so near the plane through the mean across the sum of area times normal, lattice
  /// units; the radius where the normals cancel out.
  double thickness = 0;
  std::array<double, 6> facing{};  ///< sum of area * max(0, n . axis), axes +x -x +y -y +z -z
  std::array<std::array<double, 3>, 6> flux{};  ///< the same times radiance
  std::array<float, 3> cone_axis{};             ///< unit
  float cone_cos = -1;  ///< every normal is within the cone: n . axis >= cone_cos
};

/// One child of a group as it lies in a page.
struct NodeChild {
  ChildRef ref;
  NodeSummary node;
};

/// A sibling group: the children of one octree node.
struct NodeGroup {
  MortonKey cell;                   ///< low corner of the smallest cell that holds all its points
  int level = 0;                    ///< of that cell, 0 to 62
  std::vector<NodeChild> children;  ///< 1 (a root that is a leaf) to 8, in Morton order
};

/// Bytes that a group of n children takes in a page, its slot included; what pads the slot table to
/// a multiple of 8 is not.
[[nodiscard]] std::size_t node_group_bytes(std::size_t children) noexcept;

/// Appends a group as it lies in a page, padded, whose numbers must be finite and not negative. The
/// sphere and the cone are widened by what rounding moves their centre and axis.
/// @throws std::invalid_argument when it has no or more than 8 children
void append_group(const NodeGroup& group, std::vector<std::byte>& out);

/// Changes the reference of child i of an encoded group; it stays interior or a leaf.
void set_reference(std::span<std::byte> group, int i, const ChildRef& ref) noexcept;

/// A view of one group in a page: the columns that shading reads. Valid as long as the payload.
///
///   0  u64 cell.high   8 u64 cell.low
///   16 u8 level   17 u8 n   18 u8 interior mask   19 u8 0   20 u32 0
///   24 u64 child[n]        interior: page | slot << 32     leaf: first point | count << 48
///      u16 mean_x[n] mean_y[n] mean_z[n]    in the cell: mean = corner + v / 65536 * cell edge
///      u16 radius[n]                        ufloat16 rounded up, lattice units
///      u16 cone_axis[n]                     octahedral8
///      u16 cone_cos[n]                      snorm16 rounded down
///      u16 area[n]                          ufloat16, scene units squared
///      u16 thickness[n]                     ufloat16 rounded up, lattice units
///      u16 facing[6][n]                     unorm16 of facing / area
///      u32 radiance[6][n]                   rgbe of flux / facing
class GroupView {
 public:
  explicit GroupView(const std::byte* group) noexcept : p_(group) {}

  [[nodiscard]] MortonKey cell() const noexcept {
    return {load<std::uint64_t>(0), load<std::uint64_t>(8)};
  }
  [[nodiscard]] int level() const noexcept { return static_cast<int>(p_[16]); }
  [[nodiscard]] int size() const noexcept { return static_cast<int>(p_[17]); }
  [[nodiscard]] unsigned interior_mask() const noexcept { return static_cast<unsigned>(p_[18]); }
  /// The stored reference of a child, see decode_reference().
  [[nodiscard]] std::uint64_t reference(int i) const noexcept {
    return load<std::uint64_t>(24 + 8 * static_cast<std::size_t>(i));
  }
  [[nodiscard]] ChildRef child(int i) const noexcept {
    return decode_reference(reference(i), (interior_mask() >> i & 1) != 0);
  }

  [[nodiscard]] const std::byte* mean_x() const noexcept { return column(0); }
  [[nodiscard]] const std::byte* mean_y() const noexcept { return column(1); }
  [[nodiscard]] const std::byte* mean_z() const noexcept { return column(2); }
  [[nodiscard]] const std::byte* radius() const noexcept { return column(3); }
  [[nodiscard]] const std::byte* cone_axis() const noexcept { return column(4); }
  [[nodiscard]] const std::byte* cone_cos() const noexcept { return column(5); }
  [[nodiscard]] const std::byte* area() const noexcept { return column(6); }
  [[nodiscard]] const std::byte* thickness() const noexcept { return column(7); }
  /// unorm16 of axis k.
  [[nodiscard]] const std::byte* facing(int k) const noexcept { return column(8 + k); }
  /// rgbe of axis k.
  [[nodiscard]] const std::byte* radiance(int k) const noexcept { return column(14 + 2 * k); }

  /// The group as it lies in the page, without what pads it.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept {
    return {p_, group_content_bytes(static_cast<std::size_t>(size()))};
  }

  /// The i-th value of a u16 column.
  [[nodiscard]] static std::uint16_t u16_at(const std::byte* column, int i) noexcept {
    std::uint16_t v;
    std::memcpy(&v, column + 2 * std::ptrdiff_t{i}, 2);
    return v;
  }

 private:
  template <class T>
  [[nodiscard]] T load(std::size_t at) const noexcept {
    T v;
    std::memcpy(&v, p_ + at, sizeof v);
    return v;
  }
  [[nodiscard]] const std::byte* column(int k) const noexcept {
    return p_ + 24 + std::ptrdiff_t{8 + 2 * k} * size();
  }
  const std::byte* p_;
};

/// Collects groups into one page's payload.
class NodePageEncoder {
 public:
  /// @param payload_limit  page size - 64; of more than 512 KiB the rest stays unused, as slots
  ///                       count 8 bytes in 16 bits
  explicit NodePageEncoder(std::size_t payload_limit);
  /// True when a group of n children still fits.
  [[nodiscard]] bool fits(std::size_t children) const noexcept;
  /// Appends a group as append_group() does. @return its slot
  /// @throws std::invalid_argument when it does not fit, or has no or more than 8 children
  std::uint16_t add(const NodeGroup& group);
  /// The same of a group that is encoded already; it lies outside of this.
  std::uint16_t add(const GroupView& group);
  [[nodiscard]] std::uint32_t size() const noexcept;
  /// The payload; the encoder is empty afterwards.
  [[nodiscard]] std::vector<std::byte> take();

 private:
  /// @return the new group's slot @throws std::invalid_argument when a group of n children does not
  /// fit
  std::uint16_t new_slot(std::size_t children);

  std::size_t limit_;
  std::vector<std::uint16_t> slots_;
  std::vector<std::byte> groups_;
};

/// A decoded node page: a view into its payload, checked whole when it is made.
class NodePage {
 public:
  /// Checks slots, sizes, levels, masks and references that need no other page: every group lies in
  /// the payload, leaf runs end at or before `points`, page references are below `page_count`.
  /// @throws FormatError
  NodePage(std::span<const std::byte> payload, std::uint32_t group_count, std::uint32_t page_count,
           std::uint64_t points);
  /// Trusts a payload that passed the check when its frame was loaded.
  NodePage(const std::byte* payload, std::uint32_t group_count) noexcept
      : payload_(payload), count_(group_count) {}

  [[nodiscard]] std::uint32_t size() const noexcept { return count_; }
  [[nodiscard]] GroupView operator[](std::uint32_t slot) const noexcept {
    std::uint16_t unit;
    std::memcpy(&unit, payload_ + 2 * std::size_t{slot}, 2);
    return GroupView(payload_ + 8 * std::size_t{unit});
  }
  /// The group with its numbers widened, for tools and tests.
  [[nodiscard]] NodeGroup decode(std::uint32_t slot) const;

 private:
  const std::byte* payload_;
  std::uint32_t count_;
};

}  // namespace ptc
