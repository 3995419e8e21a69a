// The nearest of a few hundred candidates are found without sorting them. One loop computes squared
// distances and keeps those that may be wanted, judging by the query before. Another counts those
// up to a limit, and the limit closes in on the wanted count as in a search by interpolation,
// because on a surface the count grows in proportion to the squared distance:
//
//     count ^            . '
//     wanted|-------.'|            low and high enclose the limit at which exactly as many as
//           |    .'   |            wanted are within; the next limit is where the chord between
//           |  .' |   |            them crosses the wanted count
//           +-----+---+------> squared distance
//              low   high
//
// Where several candidates are at the same distance no such limit may exist. Then the few between
// low and high are put in order.
#include "engine/scan/neighbour_kernels.h"

#include <algorithm>
#include <bit>
#include <limits>

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scan/neighbour_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, 8>;
using H = hn::Rebind<float, D>;  // as many floats as a vector has doubles
using F = hn::CappedTag<float, 16>;
using U = hn::RebindToUnsigned<F>;
using M = hn::Mask<F>;

constexpr int kSteps = 12;  // limits that are tried before the rest is put in order

/// Returns the lanes of a mask as bits, the first lane in bit 0.
template <class Tag>
HWY_INLINE unsigned bits_of(Tag tag, hn::Mask<Tag> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(tag, mask, bytes);
  return bytes[0] | unsigned{bytes[1]} << 8;
}

#if HWY_TARGET == HWY_AVX2
/// For each mask of 8 lanes, the numbers of the lanes in it, four bits each, the first in the
/// lowest bits.
constexpr std::array<std::uint32_t, 256> lanes_of_masks() {
  std::array<std::uint32_t, 256> table{};
  for (unsigned mask = 0; mask < 256; ++mask) {
    unsigned shift = 0;
    for (unsigned lane = 0; lane < 8; ++lane) {
      if ((mask >> lane & 1) == 0) continue;
      table[mask] |= lane << shift;
      shift += 4;
    }
  }
  return table;
}
constexpr std::array<std::uint32_t, 256> kLanesOfMasks = lanes_of_masks();
#endif

/// Stores the lanes of a mask of two vectors one after another. Vectors are written whole.
/// @return the number of lanes
HWY_INLINE std::size_t append(M mask, hn::VFromD<F> value, hn::VFromD<U> index, float* values,
                              std::uint32_t* indices) {
  const F f;
  const U u;
#if HWY_TARGET == HWY_AVX2  // the library would copy its table on each call
  const auto bits = static_cast<unsigned>(_mm256_movemask_ps(mask.raw));
  const auto lanes =
      hn::And(hn::Shr(hn::Set(u, kLanesOfMasks[bits]), hn::Mul(hn::Iota(u, 0), hn::Set(u, 4))),
              hn::Set(u, 7));
  const auto order = hn::IndicesFromVec(f, lanes);
  hn::StoreU(hn::TableLookupLanes(value, order), f, values);
  hn::StoreU(hn::BitCast(u, hn::TableLookupLanes(hn::BitCast(f, index), order)), u, indices);
  return static_cast<std::size_t>(std::popcount(bits));
#else
  hn::StoreU(hn::Compress(value, mask), f, values);
  hn::StoreU(hn::Compress(index, hn::RebindMask(u, mask)), u, indices);
  return hn::CountTrue(f, mask);
#endif
}

/// Appends the places of a group that lie in the box.
/// @param half  half the extents of the box, rounded up
HWY_INLINE std::size_t gather_group(const PageView& page, std::size_t group, const CentredBox& box,
                                    const std::array<float, 3>& half, std::uint32_t first_id,
                                    Candidates& out, std::size_t count) {
  const D d;
  const H h;
  float *const xs = out.x.data(), *const ys = out.y.data(), *const zs = out.z.data();
  std::uint32_t* const ids = out.id.data();
  for (std::size_t at = group * kGroupPlaces; at < (group + 1) * kGroupPlaces; at += hn::Lanes(d)) {
    const auto relative = [&](std::size_t k) {
      return hn::DemoteTo(h,
                          hn::Sub(hn::LoadU(d, page.position[k] + at), hn::Set(d, box.centre[k])));
    };
    const auto x = relative(0), y = relative(1), z = relative(2);
    const auto in = hn::And(
        hn::Le(hn::Abs(x), hn::Set(h, half[0])),
        hn::And(hn::Le(hn::Abs(y), hn::Set(h, half[1])), hn::Le(hn::Abs(z), hn::Set(h, half[2]))));
    alignas(64) float lanes[3][hn::MaxLanes(D())];
    hn::Store(x, h, lanes[0]);
    hn::Store(y, h, lanes[1]);
    hn::Store(z, h, lanes[2]);
    // Write every lane, and keep the place after it only where the lane is in the box.
    const unsigned bits = bits_of(h, in);
    for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
      xs[count] = lanes[0][lane];
      ys[count] = lanes[1][lane];
      zs[count] = lanes[2][lane];
      ids[count] = first_id + static_cast<std::uint32_t>(at + lane);
      count += bits >> lane & 1U;
    }
  }
  return count;
}

}  // namespace

bool gather_page(const PageView& page, const CentredBox& box, std::uint32_t first_id,
                 Candidates& out) {
  const D d;
  constexpr float kUp = 1 + 0x1p-20F;
  const std::array<float, 3> half{static_cast<float>(box.half[0]) * kUp,
                                  static_cast<float>(box.half[1]) * kUp,
                                  static_cast<float>(box.half[2]) * kUp};
  std::size_t count = out.count;
  for (std::size_t first = 0; first < page.groups; first += hn::Lanes(d)) {
    // Find the groups whose boxes overlap the box.
    auto meets = hn::FirstN(d, hn::Lanes(d));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto low = hn::LoadU(d, page.low[k] + first);
      const auto high = hn::LoadU(d, page.high[k] + first);
      meets = hn::And(meets, hn::And(hn::Le(low, hn::Set(d, box.centre[k] + box.half[k])),
                                     hn::Ge(high, hn::Set(d, box.centre[k] - box.half[k]))));
    }
    // Take their places.
    for (unsigned bits = bits_of(d, meets); bits != 0; bits &= bits - 1) {
      if (count + kGroupPlaces > out.capacity) return false;
      const std::size_t group = first + static_cast<std::size_t>(std::countr_zero(bits));
      count = gather_group(page, group, box, half, first_id, out, count);
    }
  }
  out.count = count;
  return true;
}

namespace {

/// Returns the number of distances up to a limit.
HWY_INLINE std::size_t count_within(const float* squared, std::size_t count, float limit) {
  const F f;
  std::size_t within = 0;
  for (std::size_t i = 0; i < count; i += hn::Lanes(f))
    within += hn::CountTrue(f, hn::Le(hn::LoadU(f, squared + i), hn::Set(f, limit)));
  return within;
}

/// Returns the distance of the n-th of the candidates that are farther than `low` and not farther
/// than `high`, in ascending order.
float distance_between(const float* squared, std::size_t count, float low, float high,
                       std::size_t n) {
  std::vector<float> between;
  for (std::size_t i = 0; i < count; ++i) {
    if (squared[i] > low && squared[i] <= high) between.push_back(squared[i]);
  }
  std::ranges::nth_element(between, between.begin() + static_cast<std::ptrdiff_t>(n - 1));
  return between[n - 1];
}

/// Returns the distance of the last of the wanted candidates. @pre 0 < wanted < count
float last_distance(const float* squared, std::size_t count, std::size_t wanted, float guess) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  float low = -1, high = kInfinity;
  std::size_t at_low = 0, at_high = count;
  float limit = guess;
  for (int step = 0; step < kSteps; ++step) {
    const std::size_t within = count_within(squared, count, limit);
    if (within == wanted) return limit;
    (within < wanted ? low : high) = limit;
    (within < wanted ? at_low : at_high) = within;
    // Go where the chord crosses the wanted count, or farther out while nothing is above.
    if (high == kInfinity) {
      limit *= std::min(4.0F, 1.1F * static_cast<float>(wanted + 1) /
                                  static_cast<float>(std::max<std::size_t>(1, within)));
    } else {
      const float base = std::max(0.0F, low);
      const float share = (static_cast<float>(wanted - at_low) + 0.5F) /
                          (static_cast<float>(at_high - at_low) + 1.0F);
      limit = base + (high - base) * share;
    }
    if (!(limit > low && limit < high)) break;
  }
  return distance_between(squared, count, low, high, wanted - at_low);
}

/// Computes all distances, and keeps the candidates up to a limit. @return their number
HWY_INLINE std::size_t keep_within(Candidates& candidates, const std::array<float, 3>& position,
                                   float limit) {
  const F f;
  const U u;
  const auto px = hn::Set(f, position[0]), py = hn::Set(f, position[1]),
             pz = hn::Set(f, position[2]);
  const float *xs = candidates.x.data(), *ys = candidates.y.data(), *zs = candidates.z.data();
  float *squared = candidates.squared.data(), *near = candidates.near_squared.data();
  std::uint32_t* index = candidates.near_index.data();
  std::size_t kept = 0;
  const auto step = hn::Set(u, static_cast<std::uint32_t>(hn::Lanes(f)));
  auto numbers = hn::Iota(u, 0);  // of the candidates in the lanes; Iota() is slow
  for (std::size_t i = 0; i < candidates.count; i += hn::Lanes(f)) {
    const auto x = hn::Sub(hn::LoadU(f, xs + i), px);
    const auto y = hn::Sub(hn::LoadU(f, ys + i), py);
    const auto z = hn::Sub(hn::LoadU(f, zs + i), pz);
    const auto sum = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    hn::StoreU(sum, f, squared + i);
    kept += append(hn::Le(sum, hn::Set(f, limit)), sum, numbers, near + kept, index + kept);
    numbers = hn::Add(numbers, step);
  }
  return kept;
}

}  // namespace

std::size_t find_nearest(Candidates& candidates, const std::array<float, 3>& position,
                         std::size_t wanted, float guess, std::uint32_t* found, float& farthest) {
  constexpr float kAll = std::numeric_limits<float>::max();  // the slack is at infinity
  constexpr float kMargin = 1.1F;
  const std::size_t count = candidates.count;
  float limit = wanted < count && guess > 0 ? kMargin * guess : kAll;
  std::size_t kept = keep_within(candidates, position, limit);
  while (kept < wanted && limit < kAll) {
    limit = limit < guess * 16 ? 2 * limit : kAll;
    kept = keep_within(candidates, position, limit);
  }
  // Find the distance of the last one, then take all up to it.
  const F f;
  const U u;
  float* squared = candidates.near_squared.data();
  const std::uint32_t* index = candidates.near_index.data();
  std::fill_n(squared + kept, hn::Lanes(f), std::numeric_limits<float>::infinity());
  const float last = wanted < kept ? last_distance(squared, kept, wanted, guess) : kAll;
  std::size_t taken = 0;
  auto greatest = hn::Zero(f);
  for (std::size_t i = 0; i < kept; i += hn::Lanes(f)) {
    const auto distances = hn::LoadU(f, squared + i);
    const auto in = hn::Le(distances, hn::Set(f, last));
    greatest = hn::Max(greatest, hn::IfThenElseZero(in, distances));
    // The distances that are packed here are behind those that are still to be read.
    taken += append(in, distances, hn::LoadU(u, index + i), squared + taken, found + taken);
  }
  farthest = hn::GetLane(hn::MaxOfLanes(f, greatest));
  // Give back the last of those that are equally far, where they are too many.
  for (std::size_t i = taken; taken > wanted && i-- > 0;) {
    if (candidates.squared[found[i]] != farthest) continue;
    std::copy(found + i + 1, found + taken, found + i);
    --taken;
  }
  return taken;
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(gather_page);
HWY_EXPORT(find_nearest);

Candidates::Candidates(std::size_t most)
    : capacity(most),
      x(most + kSlack),
      y(most + kSlack),
      z(most + kSlack),
      id(most + kSlack),
      squared(most + kSlack),
      near_squared(most + kSlack),
      near_index(most + kSlack) {}

bool gather_page(const PageView& page, const CentredBox& box, std::uint32_t first_id,
                 Candidates& out) {
  const bool complete = HWY_DYNAMIC_DISPATCH(gather_page)(page, box, first_id, out);
  std::fill_n(out.x.begin() + static_cast<std::ptrdiff_t>(out.count), kGroupPlaces,
              std::numeric_limits<float>::infinity());
  return complete;
}

std::size_t find_nearest(Candidates& candidates, const std::array<float, 3>& position,
                         std::size_t wanted, float guess, std::uint32_t* found, float& farthest) {
  return HWY_DYNAMIC_DISPATCH(find_nearest)(candidates, position, wanted, guess, found, farthest);
}

}  // namespace ptc
#endif
