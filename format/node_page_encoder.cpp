// Encodes summaries as columns (spec/nodes.md#quantisation).
//
// Shading relies on bounds: sphere and slab hold all discs, the cone holds all normals. So every
// bound is rounded outwards. A reader sees only stored values, so a bound is first widened by the
// error of what it refers to:
//
//   sphere about the mean        radius + |mean - stored mean|
//   slab across a normal         thickness + |mean - stored mean| + radius * |normal - stored one|
//   cone about an axis           half angle + angle(axis, stored axis)
//
// Areas, shares and radiance are not bounds; they are rounded to nearest.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "format/bytes.h"
#include "format/node_layout.h"
#include "format/node_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxPayload = (0xffff + 1) * kSlotUnit;
constexpr double kMaxFloat = std::numeric_limits<float>::max();

// Returns the least float that is not below x >= 0, or the greatest float.
float float_above(double x) noexcept {
  const auto nearest = static_cast<float>(std::min(x, kMaxFloat));
  return nearest < x ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

// Returns the whole number nearest to x >= 0, halves up.
std::uint16_t to_u16(double x) noexcept {
  const double shifted = x + 0.5;
  return static_cast<std::uint16_t>(shifted);
}

float to_float(double x) noexcept {
  return static_cast<float>(std::min(x, kMaxFloat));
}

// Says whether x is finite and not negative.
bool sane(double x) noexcept {
  return x >= 0 && x <= std::numeric_limits<double>::max();
}

[[maybe_unused]] bool all_sane(const std::array<double, 3>& values) noexcept {
  return std::ranges::all_of(values, sane);
}

[[maybe_unused]] bool storable(const NodeSummary& node) noexcept {
  return std::ranges::all_of(node.mean, [](double x) { return std::isfinite(x); }) &&
         sane(node.radius) && sane(node.area) && sane(node.thickness) && sane(node.greatest) &&
         std::ranges::all_of(node.facing, sane) && std::ranges::all_of(node.flux, all_sane) &&
         std::ranges::all_of(node.power, all_sane) &&
         std::ranges::all_of(node.cone_axis, [](float x) { return std::isfinite(x); }) &&
         std::abs(node.cone_cos) <= 1;
}

std::uint64_t encode_ref(const ChildRef& ref) noexcept {
  if (ref.interior) return ref.page | std::uint64_t{ref.slot} << 32;
  assert(ref.point_count >= 1 && ref.point_count <= kMaxLeafPoints);
  assert(ref.first_point >> kFirstPointBits == 0);
  return ref.first_point | std::uint64_t{ref.point_count} << kFirstPointBits;
}

// Returns cos(a + d) rounded down, where a is the cone's half angle and d the angle between its
// axis and the stored one; -1 when a + d reaches pi. It uses square roots only, which give the same
// bytes on every machine.
std::int16_t encode_cone_cos(const NodeSummary& node, std::uint16_t stored_axis) noexcept {
  constexpr double kFloatSlack = 4e-7;  // normals and axes are unit vectors to float precision
  // Find the angle d by its sine and cosine, up to a common factor.
  const std::array<float, 3> b = decode_octahedral8(stored_axis);
  const auto& a = node.cone_axis;
  std::array<double, 3> cross;
  double dot = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const std::size_t k = (i + 2) % 3;
    cross[i] = double{a[j]} * b[k] - double{a[k]} * b[j];
    dot += double{a[i]} * b[i];
  }
  const double sine = std::sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
  const double length = std::sqrt(sine * sine + dot * dot);
  // Add it to the half angle: cos(a + d) = cos a cos d - sin a sin d.
  const double c = node.cone_cos;
  double widened = -1;
  if (length > 0 && c + dot / length > 0) {
    widened = (c * dot - std::sqrt(std::max(0.0, 1 - c * c)) * sine) / length;
  }
  // Round down.
  const double steps = std::max((widened - kFloatSlack) * kCosSteps, -kCosSteps);
  return static_cast<std::int16_t>(static_cast<int>(steps + kCosSteps + 1) - 32768);  // floor
}

// Writes the columns of child i of a group of n.
class ChildEncoder {
 public:
  ChildEncoder(std::byte* group, std::size_t n, std::size_t i, const LatticePoint& corner,
               double edge, bool emits)
      : group_(group), n_(n), i_(i), corner_(corner), edge_(edge), emits_(emits) {}

  void encode(const NodeChild& child) {
    assert(storable(child.node));
    store(group_, kGroupHeadBytes + 8 * i_, encode_ref(child.ref));
    encode_light(child.node);
    encode_bounds(child.node);
    const std::uint16_t axis = encode_octahedral8(child.node.cone_axis);
    put(kConeAxis, axis);
    put(kConeCos, static_cast<std::uint16_t>(encode_cone_cos(child.node, axis)));
  }

 private:
  void put(std::size_t column, std::uint16_t value) {
    store(group_, column_at(n_, column) + 2 * i_, value);
  }

  // Writes mean, sphere and slab. The sphere and the slab are widened by as much as rounding moves
  // the mean, the slab also by as much as rounding turns its normal.
  void encode_bounds(const NodeSummary& node) {
    double moved_squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto corner = static_cast<double>(corner_[axis]);
      const double steps = (node.mean[axis] - corner) * (kMeanSteps / edge_);
      const std::uint16_t stored = to_u16(std::clamp(steps, 0.0, kMeanSteps - 1));
      put(kMeanX + axis, stored);
      const double moved = node.mean[axis] - (corner + stored * (edge_ / kMeanSteps));
      moved_squared += moved * moved;
    }
    double radius = node.radius;
    double thickness = node.thickness + node.radius * turn_of_slab(node);
    if (moved_squared > 0) {  // a relative 2^-50 covers the rounding errors of these lines
      radius = (radius + std::sqrt(moved_squared)) * (1 + 0x1p-50);
      thickness = (thickness + std::sqrt(moved_squared)) * (1 + 0x1p-50);
    }
    put(kRadius, encode_ufloat16_up(float_above(radius)));
    put(kThickness, encode_ufloat16_up(float_above(std::min(thickness, radius))));
    put(kGreatest, encode_ufloat16_up(float_above(node.greatest)));
  }

  // Returns the distance between the exact unit normal of the slab and the one that the stored
  // shares give. It is 1 when one of them does not exist, so that the slab becomes as thick as the
  // sphere.
  [[nodiscard]] double turn_of_slab(const NodeSummary& node) const noexcept {
    std::array<double, 3> exact;
    std::array<double, 3> stored;
    double exact_squared = 0;
    double stored_squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto share = [&](std::size_t k) {
        return static_cast<double>(
            load<std::uint16_t>(group_, column_at(n_, kFacing + k) + 2 * i_));
      };
      exact[axis] = node.facing[2 * axis] - node.facing[2 * axis + 1];
      stored[axis] = share(2 * axis) - share(2 * axis + 1);
      exact_squared += exact[axis] * exact[axis];
      stored_squared += stored[axis] * stored[axis];
    }
    if (!(exact_squared > 0 && stored_squared > 0)) return 1;
    double apart = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double d =
          exact[axis] / std::sqrt(exact_squared) - stored[axis] / std::sqrt(stored_squared);
      apart += d * d;
    }
    return std::sqrt(apart);
  }

  // Writes the mean light of a sum over what faces an axis.
  void put_light(std::size_t column, const std::array<double, 3>& sum, double facing) {
    store(group_, column_at(n_, column) + 4 * i_,
          encode_rgbe(
              {to_float(sum[0] / facing), to_float(sum[1] / facing), to_float(sum[2] / facing)}));
  }

  // Writes area, shares, radiance and emission.
  void encode_light(const NodeSummary& node) {
    const std::uint16_t area = encode_ufloat16(to_float(node.area));
    put(kArea, area);
    if (area == 0) return;  // shares and light stay 0
    for (std::size_t k = 0; k < 6; ++k) {
      const double facing = node.facing[k];
      if (!(facing > 0)) continue;  // share and light stay 0
      const double share = std::min(facing / node.area, 1.0);
      put(kFacing + k, to_u16(share * kFacingSteps));
      put_light(kRadiance + 2 * k, node.flux[k], facing);
      if (emits_) put_light(kEmission + 2 * k, node.power[k], facing);
    }
  }

  std::byte* group_;
  std::size_t n_;
  std::size_t i_;
  const LatticePoint& corner_;
  double edge_;
  bool emits_;
};

}  // namespace

void append_group(const NodeGroup& group, std::vector<std::byte>& out) {
  const std::size_t n = group.children.size();
  if (n < 1 || n > kMaxChildren)
    throw std::invalid_argument("append_group: a group must have 1 to 8 children");
  assert(group.level >= 0 && group.level <= kMaxLevel);
  assert(cell_of(group.cell, std::min(group.level, kLatticeBits)) == group.cell);

  // Write the head and the padding.
  const std::size_t at = out.size();
  const bool emits = emits_light(group);
  out.resize(at + round_to_slot(group_content_bytes(n, emits)));
  std::byte* const to = out.data() + at;
  store(to, 0, group.cell.high);
  store(to, 8, group.cell.low);
  store(to, 16, static_cast<std::uint8_t>(group.level));
  store(to, 17, static_cast<std::uint8_t>(n));

  // Write the columns, child by child.
  const LatticePoint corner = decode_morton(group.cell);
  std::uint8_t interior_mask = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const NodeChild& child = group.children[i];
    interior_mask = static_cast<std::uint8_t>(interior_mask | unsigned{child.ref.interior} << i);
    ChildEncoder(to, n, i, corner, cell_edge(group.level), emits).encode(child);
  }
  store(to, 18, interior_mask);
  store(to, 19, static_cast<std::uint8_t>(emits ? kEmitsFlag : 0));
}

bool emits_light(const NodeGroup& group) noexcept {
  return std::ranges::any_of(group.children, [](const NodeChild& c) { return c.node.emits; });
}

void set_reference(std::span<std::byte> group, int i, const ChildRef& ref) noexcept {
  store(group.data(), kGroupHeadBytes + 8 * static_cast<std::size_t>(i), encode_ref(ref));
}

NodePageEncoder::NodePageEncoder(std::size_t payload_limit)
    : limit_(std::min(payload_limit, kMaxPayload)) {}

bool NodePageEncoder::fits(std::size_t children, bool emits) const noexcept {
  const std::size_t table = round_to_slot(sizeof(std::uint16_t) * (slots_.size() + 1));
  const std::size_t group = round_to_slot(group_content_bytes(children, emits));
  return table + groups_.size() + group <= limit_;
}

std::uint16_t NodePageEncoder::new_slot(std::size_t children, bool emits) {
  if (children < 1 || children > kMaxChildren || !fits(children, emits)) {
    throw std::invalid_argument(
        "NodePageEncoder: a group must have 1 to 8 children and fit the page");
  }
  slots_.push_back(
      static_cast<std::uint16_t>(groups_.size() / kSlotUnit));  // take() adds the table's size
  return static_cast<std::uint16_t>(slots_.size() - 1);
}

std::uint16_t NodePageEncoder::add(const NodeGroup& group) {
  const std::uint16_t slot = new_slot(group.children.size(), emits_light(group));
  append_group(group, groups_);
  return slot;
}

std::uint16_t NodePageEncoder::add(const GroupView& group) {
  const std::uint16_t slot = new_slot(static_cast<std::size_t>(group.size()), group.emits());
  const std::span<const std::byte> content = group.bytes();
  groups_.insert(groups_.end(), content.begin(), content.end());
  groups_.resize(round_to_slot(groups_.size()));
  return slot;
}

std::uint32_t NodePageEncoder::size() const noexcept {
  return static_cast<std::uint32_t>(slots_.size());
}

std::size_t NodePageEncoder::bytes() const noexcept {
  return round_to_slot(sizeof(std::uint16_t) * slots_.size()) + groups_.size();
}

std::vector<std::byte> NodePageEncoder::take() {
  const std::size_t table = round_to_slot(sizeof(std::uint16_t) * slots_.size());
  std::vector<std::byte> payload(table + groups_.size());
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    const std::size_t unit = table / kSlotUnit + slots_[i];
    store(payload.data(), 2 * i, static_cast<std::uint16_t>(unit));
  }
  std::ranges::copy(groups_, payload.begin() + static_cast<std::ptrdiff_t>(table));
  slots_.clear();
  groups_.clear();
  return payload;
}

}  // namespace ptc
