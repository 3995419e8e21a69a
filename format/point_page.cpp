// Columns of surfels (spec/points.md#point-page).
//
//   | x: 4 n bytes | y | z | high | radius | normal u: 2 n bytes | v | radiance r | g | b | ...
//
// Every page is verified when it is loaded, so the checks are loops that compilers make vectors of.
// The costly rule is that points follow the Z-curve. It does not need their keys: of two points,
// the one that comes first is decided by the axis whose coordinates differ in the most significant
// bit (Chan 2002). A loop over whole columns only says whether a rule is broken; the place is found
// by a second look, which is rare.
#include "format/point_page.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "format/bytes.h"
#include "format/error.h"
#include "format/packed_layout.h"
#include "format/page_facts.h"

namespace ptc {
namespace {

constexpr std::uint32_t kHighMask = (1u << kHighBits) - 1;
constexpr std::uint32_t kHighLimit = 1u << (3 * kHighBits);

// Bytes per point in front of each column.
constexpr std::size_t kPosition = 0;  // x, y, z
constexpr std::size_t kRadius = 16;
constexpr std::size_t kNormal = 20;
constexpr std::size_t kRadiance = 24;
constexpr std::size_t kAlbedo = 30;
constexpr std::size_t kFlags = 33;
constexpr std::size_t kEmission = 34;

// The order of points along the Z-curve is checked in 32-bit lanes: the upper 31 bits of each
// coordinate first and then, where these are equal on all axes, the lower 11.
//
//   bit 41 ....... 11 | 10 ...... 0
constexpr int kLowerBits = 11;
constexpr std::size_t kRunPoints = 128;  // so that the lanes of a run stay in the L1 cache

// The upper or lower parts of the coordinates of a run of points and the point behind it.
struct Lanes {
  std::array<std::array<std::int32_t, kRunPoints + 1>, 3> axes;
};

// Loads the upper or lower parts of the coordinates of points first to first + n - 1.
void split(const std::byte* payload, std::size_t count, std::size_t first, std::size_t n,
           bool upper, Lanes& out) noexcept {
  const std::byte* const high = payload + kHigh * count + 4 * first;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::byte* const low = payload + 4 * axis * count + 4 * first;
    auto& lanes = out.axes[axis];
    for (std::size_t i = 0; i < n; ++i) {
      const auto bits = load<std::uint32_t>(low, 4 * i);
      const std::uint32_t top = load<std::uint32_t>(high, 4 * i) >> (kHighBits * axis) & kHighMask;
      const std::uint32_t part =
          upper ? top << (32 - kLowerBits) | bits >> kLowerBits : bits & ((1u << kLowerBits) - 1);
      lanes[i] = static_cast<std::int32_t>(part);
    }
  }
}

// A truth value with all bits one for true and zero for false, so that compilers make vectors of
// the loops below.
using Mask = std::int32_t;

inline Mask below(std::int32_t a, std::int32_t b) noexcept {
  return a < b ? -1 : 0;
}
inline Mask choose(Mask m, Mask yes, Mask no) noexcept {
  return (m & yes) | (~m & no);
}

// Says whether the most significant bit of a is below that of b; neither is negative (Chan 2002,
// "Closest-point problems simplified"; here as one comparison).
inline Mask below_msb(std::int32_t a, std::int32_t b) noexcept {
  return below(a, b & ~a);
}

// Says whether point j comes after point i. The axis whose coordinates differ in the most
// significant bit decides; among equals z decides before y, and y before x.
inline Mask follows(const Lanes& p, std::size_t i, std::size_t j) noexcept {
  const auto& [x, y, z] = p.axes;
  const std::int32_t differ_x = x[i] ^ x[j];
  const std::int32_t differ_y = y[i] ^ y[j];
  const std::int32_t differ_z = z[i] ^ z[j];
  const Mask xy = choose(below_msb(differ_y, differ_x), below(x[i], x[j]), below(y[i], y[j]));
  return choose(below_msb(differ_z, differ_x | differ_y), xy, below(z[i], z[j]));
}

inline Mask equal(const Lanes& p, std::size_t i, std::size_t j) noexcept {
  const auto& [x, y, z] = p.axes;
  return ((x[i] ^ x[j]) | (y[i] ^ y[j]) | (z[i] ^ z[j])) == 0 ? -1 : 0;
}

// Says whether each of n points is followed or equalled by the next one.
bool run_ascends(const std::byte* payload, std::size_t count, std::size_t first,
                 std::size_t n) noexcept {
  // Compare the upper bits.
  Lanes upper;
  split(payload, count, first, n + 1, true, upper);
  Mask ascends = -1;
  for (std::size_t i = 0; i < n; ++i) ascends &= follows(upper, i, i + 1);
  if (ascends != 0) return true;  // the usual case: points of real scenes differ in the upper bits

  // Compare the lower bits where the upper ones are equal.
  Lanes lower;
  split(payload, count, first, n + 1, false, lower);
  ascends = -1;
  for (std::size_t i = 0; i < n; ++i) {
    const Mask tie = equal(upper, i, i + 1) & ~follows(lower, i + 1, i);
    ascends &= follows(upper, i, i + 1) | tie;
  }
  return ascends != 0;
}

// Returns the index of the first point whose successor comes before it on the Z-curve, or that of
// the last point.
std::size_t first_descent(const PointPage& page, const std::byte* payload) noexcept {
  const std::size_t last = page.size() - 1;
  for (std::size_t first = 0; first < last; first += kRunPoints) {
    const std::size_t n = std::min(kRunPoints, last - first);
    if (run_ascends(payload, page.size(), first, n)) continue;
    auto i = static_cast<std::uint32_t>(first);
    while (encode_morton(page.position(i)) <= encode_morton(page.position(i + 1))) ++i;
    return i;
  }
  return last;
}

// Says whether every value is below a limit that is at most the top bit of the type. Adding the
// difference between the top bit and the limit sets the top bit of every value that is not, unless
// it was set before.
template <class T>
bool all_below(const std::byte* column, std::size_t count, T limit) noexcept {
  constexpr T kTop = static_cast<T>(T{1} << (8 * sizeof(T) - 1));
  const T lack = static_cast<T>(kTop - limit);
  T seen = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const T value = load<T>(column, i * sizeof(T));
    seen = static_cast<T>(seen | value | static_cast<T>(value + lack));
  }
  return (seen & kTop) == 0;
}

// Writes columns of `count` numbers.
class Columns {
 public:
  Columns(std::size_t count, std::uint8_t point_bytes)
      : count_(count), payload_(count * point_bytes) {}

  template <class T>
  void put(std::size_t bytes_before, std::size_t i, T value) {
    store(payload_.data() + bytes_before * count_, i * sizeof(T), value);
  }
  std::vector<std::byte> take() { return std::move(payload_); }

 private:
  std::size_t count_;
  std::vector<std::byte> payload_;
};

}  // namespace

std::uint32_t points_per_page(const FileHeader& file) noexcept {
  return payload_limit(file.page_shift) / file.point_bytes / 8 * 8;
}

bool is_storable(const PointRecord& point) noexcept {
  const auto usual = [](std::uint16_t half) { return half < 0x7c00 || half == 0x8000; };
  return point.radius >= 0 && point.radius <= std::numeric_limits<float>::max() &&
         point.flags == 0 && std::ranges::all_of(point.radiance, usual) &&
         std::ranges::all_of(point.emission, usual);
}

std::vector<std::byte> encode_point_page(std::span<const PointRecord> points,
                                         std::uint8_t point_bytes) {
  if (points.empty()) throw std::invalid_argument("encode_point_page: no points");
  assert(std::ranges::is_sorted(points, {}, &PointRecord::key) &&
         std::ranges::all_of(points, is_storable));
  Columns columns(points.size(), point_bytes);
  const auto not_negative = [](std::uint16_t half) {  // -0 becomes 0
    return half == 0x8000 ? std::uint16_t{0} : half;
  };
  PositionBlock q;
  for (std::size_t first = 0; first < points.size(); first += kPositionBlock) {
    // Decode the positions of a block of points.
    const auto block = points.subspan(first, std::min(kPositionBlock, points.size() - first));
    decode_positions(block, q);
    // Write the block to each column.
    const auto fill = [&](std::size_t bytes_before, auto&& value) {
      for (std::size_t i = 0; i < block.size(); ++i) columns.put(bytes_before, first + i, value(i));
    };
    for (std::size_t k = 0; k < 3; ++k) {
      fill(kPosition + 4 * k, [&](std::size_t i) { return static_cast<std::uint32_t>(q[k][i]); });
      fill(kRadiance + 2 * k, [&](std::size_t i) { return not_negative(block[i].radiance[k]); });
      fill(kAlbedo + k, [&](std::size_t i) { return block[i].albedo[k]; });
    }
    fill(kHigh, [&](std::size_t i) {
      return static_cast<std::uint32_t>(q[0][i] >> 32 | q[1][i] >> 32 << kHighBits |
                                        q[2][i] >> 32 << (2 * kHighBits));
    });
    fill(kRadius, [&](std::size_t i) { return block[i].radius + 0.0f; });  // -0 becomes 0
    for (std::size_t k = 0; k < 2; ++k) {
      fill(kNormal + 2 * k, [&](std::size_t i) { return block[i].normal[k]; });
    }
    fill(kFlags, [&](std::size_t i) { return block[i].flags; });
    for (std::size_t k = 0; k < 3 && point_bytes != kPointBytes; ++k) {
      fill(kEmission + 2 * k, [&](std::size_t i) { return not_negative(block[i].emission[k]); });
    }
  }
  return columns.take();
}

PointPage::PointPage(std::span<const std::byte> payload, std::uint32_t count,
                     std::uint8_t point_bytes)
    : PointPage(payload.data(), count, point_bytes) {
  if (count == 0 || payload.size() != std::size_t{point_bytes} * count) {
    throw FormatError(0, "spec/points.md#point-size",
                      "payload does not have " + std::to_string(point_bytes) + " bytes a point");
  }
}

PointRecord PointPage::operator[](std::uint32_t i) const noexcept {
  PointRecord point;
  point.key = encode_morton(position(i));
  point.radius = radius(i);
  point.normal = normal(i);
  point.radiance = radiance(i);
  point.albedo = albedo(i);
  point.flags = value<std::uint8_t>(kFlags, i);
  point.emission = emission(i);
  return point;
}

void PointPage::verify() const {
  verify_column<std::uint32_t>(kHigh, kHighLimit, "spec/points.md#point-lattice",
                               "bits 30 and 31 of high are not zero");
  const std::size_t descent = first_descent(*this, payload_);
  if (descent + 1 < count_) {
    throw FormatError(4 * (descent + 1), "spec/points.md#point-order",
                      "point " + std::to_string(descent + 1) + " precedes the point before it");
  }
  verify_column<std::uint32_t>(kRadius, 0x7f800000, "spec/points.md#point-radius",
                               "radius is negative or not finite");
  for (std::size_t k = 0; k < 3; ++k) {
    verify_column<std::uint16_t>(kRadiance + 2 * k, 0x7c00, "spec/points.md#point-radiance",
                                 "radiance is negative or not finite");
    if (!emits_) continue;
    verify_column<std::uint16_t>(kEmission + 2 * k, 0x7c00, "spec/points.md#point-radiance",
                                 "emission is negative or not finite");
  }
  verify_column<std::uint8_t>(kFlags, 1, "spec/points.md#point-flags", "flags are not zero");
}

// Compares bit patterns. Those of numbers that are not negative are ordered like the numbers, and
// all others are above them, so one limit finds negative numbers, infinities and NaN.
template <class T>
void PointPage::verify_column(std::size_t bytes_before, T limit, const char* clause,
                              const char* text) const {
  const std::byte* const values = payload_ + bytes_before * count_;
  if (all_below(values, count_, limit)) return;
  std::size_t i = 0;
  while (load<T>(values, i * sizeof(T)) < limit) ++i;
  throw FormatError(bytes_before * count_ + i * sizeof(T), clause,
                    "point " + std::to_string(i) + ": " + text);
}

}  // namespace ptc
