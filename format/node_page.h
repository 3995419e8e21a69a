// The payload of a node page: sibling groups of the octree (spec/nodes.md).
//
//   | slot table: u16 per group | group 0 | group 1 | ... |      all start at multiples of 8 bytes
//
// A sibling group holds the children of one octree node, in columns, so that shading reads a whole
// group with vector loads. A child refers either to the group of its own children, by page and
// slot, or to a run of points. Writers collect groups with NodePageEncoder. Readers make a NodePage
// from untrusted bytes: its constructor walks the payload once and checks everything that a
// GroupView later reads, so GroupView needs no checks of its own.
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

inline constexpr int kMaxChildren = 8;  ///< greatest number of children in a group
/// The greatest level of a group. The lattice ends at level 42; levels 43 to 62 split the cells of
/// coincident points by rank.
inline constexpr int kMaxLevel = 62;
inline constexpr std::uint32_t kMaxLeafPoints = 0xffff;  ///< greatest number of points in a leaf

/// A reference to what is below a node: a sibling group or a run of points.
struct ChildRef {
  bool interior = false;          ///< refers to a group; otherwise to points
  std::uint32_t page = 0;         ///< interior: rank of the node page
  std::uint16_t slot = 0;         ///< interior: slot of the group in that page
  std::uint64_t first_point = 0;  ///< leaf: index of the first point in Morton order, below 2^48
  std::uint32_t point_count = 0;  ///< leaf: number of points, 1 to kMaxLeafPoints
  friend bool operator==(const ChildRef&, const ChildRef&) = default;
};

/// Decodes a reference as it lies in a group. The word of an interior child is page | slot << 32,
/// that of a leaf is first point | count << 48.
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

/// The summary of a cluster of surfels that shading uses in place of the surfels, before it is
/// quantised.
struct NodeSummary {
  std::array<double, 3> mean{};  ///< area-weighted mean position, lattice units
  double radius = 0;  ///< of the sphere about the mean that holds all discs, lattice units
  double area = 0;    ///< sum of 2 radius^2 of the surfels, scene units squared
  /// The greatest distance of the discs from the plane through the mean that is perpendicular to
  /// the sum of area times normal, lattice units. It equals `radius` where the normals cancel out.
  double thickness = 0;
  std::array<double, 6> facing{};  ///< sum of area * max(0, n . axis), axes +x -x +y -y +z -z
  /// The sum of area * max(0, n . axis) * radiance for each of the six axes, RGB.
  std::array<std::array<double, 3>, 6> flux{};
  /// The sum of area * max(0, n . axis) * emission for each of the six axes, RGB.
  std::array<std::array<double, 3>, 6> power{};
  double greatest = 0;               ///< the greatest radius of a surfel, lattice units
  bool emits = false;                ///< whether a surfel emits light
  std::array<float, 3> cone_axis{};  ///< unit axis of a cone that holds every normal n
  float cone_cos = -1;               ///< cosine of the cone's half angle: n . axis >= cone_cos
};

/// One child of a group: its reference and its summary.
struct NodeChild {
  ChildRef ref;
  NodeSummary node;
};

/// A sibling group: the children of one octree node.
struct NodeGroup {
  MortonKey cell;                   ///< low corner of the smallest cell that holds all its points
  int level = 0;                    ///< level of that cell, 0 to 62
  std::vector<NodeChild> children;  ///< 1 (a root that is a leaf) to 8, in Morton order
};

/// Appends a group as it lies in a page, with its padding. The sphere, the slab and the cone are
/// widened by as much as quantisation moves their centre, normal and axis.
/// @param group  its numbers must be finite; all but means, axes and cosines must not be negative
/// @throws std::invalid_argument when the group has no children or more than 8
void append_group(const NodeGroup& group, std::vector<std::byte>& out);

/// Returns whether a surfel below a group emits light.
[[nodiscard]] bool emits_light(const NodeGroup& group) noexcept;

/// Changes the reference of child i of an encoded group. The kind of the child cannot change: an
/// interior child stays interior and a leaf stays a leaf.
void set_reference(std::span<std::byte> group, int i, const ChildRef& ref) noexcept;

/// A view of one group in a page: the columns that shading reads. It is valid as long as the
/// payload. No function checks its bytes: they passed the check of NodePage, or an encoder wrote
/// them.
///
///   0  u64 cell.high   8 u64 cell.low
///   16 u8 level   17 u8 n   18 u8 interior mask   19 u8 flags   20 u32 0
///   24 u64 child[n]        interior: page | slot << 32     leaf: first point | count << 48
///      u16 mean_x[n] mean_y[n] mean_z[n]    in the cell: mean = corner + v / 65536 * cell edge
///      u16 radius[n]                        ufloat16 rounded up, lattice units
///      u16 cone_axis[n]                     octahedral8
///      u16 cone_cos[n]                      snorm16 rounded down
///      u16 area[n]                          ufloat16, scene units squared
///      u16 thickness[n]                     ufloat16 rounded up, lattice units
///      u16 greatest[n]                      ufloat16 rounded up, lattice units
///      u16 facing_k[n], k = 0 to 5          unorm16 of facing / area
///      u32 radiance_k[n], k = 0 to 5        rgbe of flux / facing
///      u32 emission_k[n], k = 0 to 5        rgbe of power / facing, where the flag emits is set
class GroupView {
 public:
  /// @param group  first byte of the group
  explicit GroupView(const std::byte* group) noexcept : p_(group) {}

  /// Returns the low corner of the smallest cell that holds all points of the group.
  [[nodiscard]] MortonKey cell() const noexcept {
    return {load<std::uint64_t>(0), load<std::uint64_t>(8)};
  }
  /// Returns the level of that cell, 0 to kMaxLevel.
  [[nodiscard]] int level() const noexcept { return static_cast<int>(p_[16]); }
  /// Returns the number of children, 1 to 8.
  [[nodiscard]] int size() const noexcept { return static_cast<int>(p_[17]); }
  /// Returns a mask whose bit i says that child i is interior.
  [[nodiscard]] unsigned interior_mask() const noexcept { return static_cast<unsigned>(p_[18]); }
  /// Returns whether the group has the columns of emission; without them nothing below emits.
  [[nodiscard]] bool emits() const noexcept {
    return (static_cast<unsigned>(p_[19]) & kEmitsFlag) != 0;
  }
  /// Returns the stored reference of child i; decode_reference() explains its bits.
  [[nodiscard]] std::uint64_t reference(int i) const noexcept {
    return load<std::uint64_t>(24 + 8 * static_cast<std::size_t>(i));
  }
  /// Returns the decoded reference of child i.
  [[nodiscard]] ChildRef child(int i) const noexcept {
    return decode_reference(reference(i), (interior_mask() >> i & 1) != 0);
  }

  // Each function returns the first byte of a column of size() u16; the picture above says what
  // the values mean. Columns are not aligned to more than 2 bytes.
  [[nodiscard]] const std::byte* mean_x() const noexcept { return column(0); }
  [[nodiscard]] const std::byte* mean_y() const noexcept { return column(1); }
  [[nodiscard]] const std::byte* mean_z() const noexcept { return column(2); }
  [[nodiscard]] const std::byte* radius() const noexcept { return column(3); }
  [[nodiscard]] const std::byte* cone_axis() const noexcept { return column(4); }
  [[nodiscard]] const std::byte* cone_cos() const noexcept { return column(5); }
  [[nodiscard]] const std::byte* area() const noexcept { return column(6); }
  [[nodiscard]] const std::byte* thickness() const noexcept { return column(7); }
  [[nodiscard]] const std::byte* greatest() const noexcept { return column(8); }
  /// Returns the column of facing / area for axis k, 0 to 5, as unorm16.
  [[nodiscard]] const std::byte* facing(int k) const noexcept { return column(9 + k); }
  /// Returns the column of mean radiance towards axis k, 0 to 5, as rgbe (u32).
  [[nodiscard]] const std::byte* radiance(int k) const noexcept { return column(15 + 2 * k); }
  /// Returns the column of mean emission towards axis k, 0 to 5, as rgbe (u32). @pre emits()
  [[nodiscard]] const std::byte* emission(int k) const noexcept { return column(27 + 2 * k); }

  /// Returns the group as it lies in the page, without the padding behind it.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept {
    return {p_, group_content_bytes(static_cast<std::size_t>(size()), emits())};
  }

  /// Returns the i-th value of a column of u16.
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

/// Collects groups into the payload of one page.
class NodePageEncoder {
 public:
  /// @param payload_limit  page size - 64 bytes. At most 512 KiB of it are used, because a slot
  ///                       counts units of 8 bytes in 16 bits.
  explicit NodePageEncoder(std::size_t payload_limit);
  /// Says whether a group of n children still fits.
  /// @param emits  whether the group has the columns of emission
  [[nodiscard]] bool fits(std::size_t children, bool emits) const noexcept;
  /// Encodes a group as append_group() does and adds it. @return the slot of the group
  /// @throws std::invalid_argument when it does not fit, or has no children or more than 8
  std::uint16_t add(const NodeGroup& group);
  /// Adds a copy of a group that is encoded already, which must not alias this encoder's buffer.
  /// @return the slot of the group
  /// @throws std::invalid_argument when it does not fit
  std::uint16_t add(const GroupView& group);
  /// Returns the number of groups since the last take().
  [[nodiscard]] std::uint32_t size() const noexcept;
  /// Returns the size of the payload that take() would return, bytes.
  [[nodiscard]] std::size_t bytes() const noexcept;
  /// Returns the bytes that are left for more groups and their slots.
  [[nodiscard]] std::size_t room() const noexcept { return limit_ - bytes(); }
  /// Returns the payload of the groups that were added; the encoder is empty afterwards.
  [[nodiscard]] std::vector<std::byte> take();

 private:
  /// Appends a slot for a group of n children and returns its number.
  /// @throws std::invalid_argument when the group does not fit, or n is not 1 to 8
  std::uint16_t new_slot(std::size_t children, bool emits);

  std::size_t limit_;                 ///< greatest size of the payload, bytes
  std::vector<std::uint16_t> slots_;  ///< first unit of each group, counted from the first group
  std::vector<std::byte> groups_;     ///< the padded groups, without the slot table
};

/// A decoded node page: a view into its payload, which is checked completely on construction.
class NodePage {
 public:
  /// Checks slots, sizes, levels, masks and all references that need no other page: every group
  /// lies in the payload, leaf runs end at or before `points`, page references are below
  /// `node_pages`, and no group has emission unless `may_emit`.
  /// @param payload      the decoded payload, which must outlive this view
  /// @param group_count  PageHeader::record_count of the page
  /// @throws FormatError with the offset in the payload when a rule is broken
  NodePage(std::span<const std::byte> payload, std::uint32_t group_count, std::uint32_t node_pages,
           std::uint64_t points, bool may_emit);
  /// Makes a view without checks. @pre the payload passed the check above when it was loaded
  NodePage(const std::byte* payload, std::uint32_t group_count) noexcept
      : payload_(payload), count_(group_count) {}

  /// Returns the number of groups.
  [[nodiscard]] std::uint32_t size() const noexcept { return count_; }
  /// Returns the group in a slot below size().
  [[nodiscard]] GroupView operator[](std::uint32_t slot) const noexcept {
    std::uint16_t unit;
    std::memcpy(&unit, payload_ + 2 * std::size_t{slot}, 2);
    return GroupView(payload_ + 8 * std::size_t{unit});
  }
  /// Returns the group in a slot with its numbers decoded, for tools and tests.
  [[nodiscard]] NodeGroup decode(std::uint32_t slot) const;

 private:
  const std::byte* payload_;
  std::uint32_t count_;
};

}  // namespace ptc
