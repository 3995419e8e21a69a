// Sibling groups: the check that makes later reads safe, and the decoding of their numbers
// (spec/nodes.md#node-page).
//
// Each slot must name the place where the group before it ends, and the last group must end with
// the payload. So one pass over the page proves that no group overlaps another, that no byte is
// left over, and that every later read through any slot stays inside.
#include "format/node_page.h"

#include <algorithm>
#include <bit>

#include "format/bytes.h"
#include "format/error.h"
#include "format/node_layout.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::uint64_t kKeyLimit = std::uint64_t{1} << 63;  // halves of keys have 63 bits
constexpr std::uint16_t kUfloat16Limit = 0xff00;  // patterns from here on are infinity and NaN

// Checks a group that lies whole in the payload, `at` bytes from its start.
class GroupCheck {
 public:
  GroupCheck(const std::byte* payload, std::size_t at, std::uint32_t node_pages,
             std::uint64_t points)
      : group_(payload + at), at_(at), node_pages_(node_pages), points_(points), view_(group_) {}

  void run() const {
    check_cell();
    check_zero();
    for (int i = 0; i < view_.size(); ++i) {
      check_ref(i);
      check_numbers(i);
    }
  }

 private:
  [[noreturn]] void fail(std::size_t offset, const char* clause, const char* text) const {
    throw FormatError(at_ + offset, clause, text);
  }

  void check_cell() const {
    if (view_.level() > kMaxLevel) fail(16, "spec/nodes.md#node-level", "level is above 62");
    const MortonKey cell = view_.cell();
    if (cell.high >= kKeyLimit || cell.low >= kKeyLimit ||
        cell_of(cell, std::min(view_.level(), kLatticeBits)) != cell) {
      fail(0, "spec/nodes.md#node-cell", "cell has digits below its level");
    }
    if (view_.interior_mask() >> view_.size() != 0) {
      fail(18, "spec/nodes.md#node-mask", "interior mask names a child that does not exist");
    }
  }

  void check_zero() const {
    constexpr char kZeroClause[] = "spec/nodes.md#node-zero";
    const auto n = static_cast<std::size_t>(view_.size());
    const std::size_t end = group_content_bytes(n, view_.emits());
    if (load<std::uint32_t>(group_, 20) != 0) fail(20, kZeroClause, "reserved field is not zero");
    if (first_nonzero({group_ + end, round_to_slot(end) - end}) != round_to_slot(end) - end) {
      fail(end, kZeroClause, "padding is not zero");
    }
  }

  void check_ref(int i) const {
    const std::size_t offset = kGroupHeadBytes + 8 * static_cast<std::size_t>(i);
    const ChildRef ref = view_.child(i);
    if (ref.interior) {
      if (load<std::uint64_t>(group_, offset) >> kFirstPointBits != 0) {
        fail(offset + 6, "spec/nodes.md#node-zero", "reserved bits are not zero");
      }
      if (ref.page >= node_pages_) {
        fail(offset, "spec/nodes.md#node-reference", "child's page does not exist");
      }
    } else if (ref.point_count == 0 || ref.first_point > points_ ||
               ref.point_count > points_ - ref.first_point) {
      fail(offset, "spec/nodes.md#node-leaf", "leaf's points do not exist");
    }
  }

  void check_numbers(int i) const {
    for (const std::byte* const column :
         {view_.radius(), view_.area(), view_.thickness(), view_.greatest()}) {
      if (GroupView::u16_at(column, i) >= kUfloat16Limit) {
        fail(static_cast<std::size_t>(column - group_) + 2 * static_cast<std::size_t>(i),
             "spec/nodes.md#node-number", "a radius, area or thickness is not finite");
      }
    }
  }

  const std::byte* group_;
  std::size_t at_;
  std::uint32_t node_pages_;
  std::uint64_t points_;
  GroupView view_;
};

double snorm16(std::uint16_t bits) noexcept {
  return std::max(static_cast<double>(static_cast<std::int16_t>(bits)) / kCosSteps, -1.0);
}

/// Decodes the summary of child i into `node`, which has its default values.
void decode_summary(const GroupView& group, int i, NodeSummary& node) {
  const auto u16 = [i](const std::byte* column) { return GroupView::u16_at(column, i); };
  const LatticePoint corner = decode_morton(group.cell());
  const double step = cell_edge(group.level()) / kMeanSteps;
  const std::array columns{group.mean_x(), group.mean_y(), group.mean_z()};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    node.mean[axis] = static_cast<double>(corner[axis]) + u16(columns[axis]) * step;
  }
  node.radius = decode_ufloat16(u16(group.radius()));
  node.area = decode_ufloat16(u16(group.area()));
  node.thickness = decode_ufloat16(u16(group.thickness()));
  node.greatest = decode_ufloat16(u16(group.greatest()));
  node.emits = group.emits();
  node.cone_axis = decode_octahedral8(u16(group.cone_axis()));
  node.cone_cos = static_cast<float>(snorm16(u16(group.cone_cos())));
  for (std::size_t k = 0; k < 6; ++k) {
    const int axis = static_cast<int>(k);
    const std::uint16_t share = u16(group.facing(axis));
    if (share == 0) continue;  // facing, flux and power stay 0
    node.facing[k] = share / kFacingSteps * node.area;
    const auto light_of = [&](const std::byte* column) {
      const std::array<float, 3> light =
          decode_rgbe(load<std::uint32_t>(column, 4 * static_cast<std::size_t>(i)));
      return std::array{node.facing[k] * double{light[0]}, node.facing[k] * double{light[1]},
                        node.facing[k] * double{light[2]}};
    };
    node.flux[k] = light_of(group.radiance(axis));
    if (node.emits) node.power[k] = light_of(group.emission(axis));
  }
}

}  // namespace

NodePage::NodePage(std::span<const std::byte> payload, std::uint32_t group_count,
                   std::uint32_t node_pages, std::uint64_t points, bool may_emit)
    : payload_(payload.data()), count_(group_count) {
  // Check the slot table.
  constexpr char kSlots[] = "spec/nodes.md#node-slots";
  const std::size_t table_end = sizeof(std::uint16_t) * std::size_t{group_count};
  std::size_t at = round_to_slot(table_end);
  if (group_count == 0 || at > payload.size()) {
    throw FormatError(0, kSlots, "slot table does not fit the payload");
  }
  if (first_nonzero(payload.subspan(table_end, at - table_end)) != at - table_end) {
    throw FormatError(table_end, "spec/nodes.md#node-zero", "padding is not zero");
  }

  // Check the groups, which follow each other without a gap.
  for (std::uint32_t slot = 0; slot < group_count; ++slot) {
    const std::size_t entry = sizeof(std::uint16_t) * std::size_t{slot};
    if (load<std::uint16_t>(payload_, entry) * kSlotUnit != at) {
      throw FormatError(entry, kSlots, "group does not start where the group before it ends");
    }
    const std::size_t room = payload.size() - at;
    if (room < kGroupHeadBytes) throw FormatError(at, kSlots, "group ends past the payload");
    const auto n = load<std::uint8_t>(payload_, at + 17);
    if (n < 1 || n > kMaxChildren) {
      throw FormatError(at + 17, "spec/nodes.md#node-children",
                        "group does not have 1 to 8 children");
    }
    const unsigned flags = load<std::uint8_t>(payload_, at + 19);
    if (flags > (may_emit ? kEmitsFlag : 0)) {
      throw FormatError(at + 19, "spec/nodes.md#node-mask",
                        "group has a flag that is unknown or not allowed in this file");
    }
    const std::size_t bytes = round_to_slot(group_content_bytes(n, flags != 0));
    if (bytes > room) throw FormatError(at, kSlots, "group ends past the payload");
    GroupCheck(payload_, at, node_pages, points).run();
    at += bytes;
  }
  if (at != payload.size()) throw FormatError(at, kSlots, "bytes follow the last group");
}

NodeGroup NodePage::decode(std::uint32_t slot) const {
  const GroupView view = (*this)[slot];
  NodeGroup group;
  group.cell = view.cell();
  group.level = view.level();
  group.children.resize(static_cast<std::size_t>(view.size()));
  for (int i = 0; i < view.size(); ++i) {
    NodeChild& child = group.children[static_cast<std::size_t>(i)];
    child.ref = view.child(i);
    decode_summary(view, i, child.node);
  }
  return group;
}

}  // namespace ptc
