// A ray goes down the tree by a stack. Where that is empty it takes the next boxes of the list that
// it shares with other rays; these are sorted by their distance from the origin, so a ray ends when
// that passes what it has met.
//
//     list     [ box box box box box box box box | box box ...      8 at once
//                     |           |
//                     v           v
//     stack    group or leaf, the nearest on top --> 8 children, or up to 16 discs, at once
//
// Where discs overlap, the one of least bumped depth is seen (spec/shading.md#surfels). A bump is
// behind its disc, so the depth of a box bounds the bumped depth of what is in it.
#include "engine/trace/trace_kernels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/trace/trace_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/gather-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr float kFarAway = 0x1p100F;       ///< beyond every length
constexpr float kLeastSlope = 1e-20F;      ///< least |d_k| that a ray is divided by
constexpr float kLeastSlabSlope = 1e-12F;  ///< least |d . n| that a ray is divided by
constexpr float kSlack = 1 + 2e-6F;        ///< what rounding may take from a quotient

/// A ray.
struct Ray {
  glm::vec3 along;
  float inverse[3];  ///< 1 over each component
  bool negative[3];

  explicit Ray(const glm::vec3& d) : along(d) {
    for (int k = 0; k < 3; ++k) {
      negative[k] = std::signbit(d[k]);
      inverse[k] = 1 / std::copysign(std::max(std::abs(d[k]), kLeastSlope), d[k]);
    }
  }
};

/// Tests up to kTraceLanes boxes.
/// @param columns  of the boxes, `stride` floats from one column to the next
/// @param from     where the ray begins, as the boxes see it; null: where they are relative to
/// @param far      the depth that the ray has met something at
/// @param near     receives the depth at which the ray enters each box
/// @return         bit i: the ray may meet something in box i
template <bool kOffset>
HWY_INLINE unsigned meet_boxes(const float* columns, std::size_t stride, const Ray& ray,
                               const Beginning* from, float far, float* near) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  unsigned met = 0;
  for (unsigned at = 0; at < kTraceLanes; at += lanes) {
    const auto load = [&](std::size_t column) {
      return hn::LoadU(f, columns + column * stride + at);
    };
    auto enter = hn::Zero(f), leave = hn::Set(f, far);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto by = hn::Set(f, ray.inverse[k]);
      const std::size_t first = ray.negative[k] ? kHighX : kLowX,
                        last = ray.negative[k] ? kLowX : kHighX;
      auto a = load(first + k), b = load(last + k);
      if constexpr (kOffset) {
        const float outwards = ray.negative[k] ? -from->slack : from->slack;
        a = hn::Sub(a, hn::Set(f, from->at[k] + outwards));
        b = hn::Sub(b, hn::Set(f, from->at[k] - outwards));
      }
      enter = hn::Max(enter, hn::Mul(a, by));
      leave = hn::Min(leave, hn::Mul(b, by));
    }
    const Vec slab{load(kSlabX), load(kSlabY), load(kSlabZ)};
    const auto slope = dot(slab, spread(ray.along));
    const auto by =
        hn::Div(hn::Set(f, 1.0F),
                hn::CopySign(hn::Max(hn::Abs(slope), hn::Set(f, kLeastSlabSlope)), slope));
    auto low = load(kSlabLow), high = load(kSlabHigh);
    if constexpr (kOffset) {
      const auto begin = dot(slab, spread({from->at[0], from->at[1], from->at[2]})),
                 slack = hn::Set(f, from->slack);
      low = hn::Sub(low, hn::Add(begin, slack));
      high = hn::Sub(high, hn::Sub(begin, slack));
    }
    const auto a = hn::Mul(low, by), b = hn::Mul(high, by);
    enter = hn::Max(enter, hn::Min(a, b));
    leave = hn::Min(leave, hn::Max(a, b));
    hn::StoreU(enter, f, near + at);
    met |= bits_of(f, hn::Le(enter, hn::Mul(leave, hn::Set(f, kSlack)))) << at;
  }
  return met;
}

/// Discs that a ray meets: lanes of a vector.
struct MetDiscs {
  VF depth;   ///< bumped depth along the ray
  VF height;  ///< centre . normal; negative where the ray meets the front
  MF met;
};

/// Tests a vector of discs of a leaf. Backs within TraceRules::clear_backs of their own radii of
/// where the ray begins are clear.
/// @param at   number of the first disc
/// @param far  depth beyond which discs do not count
HWY_INLINE MetDiscs meet_discs(const TraceLeaf& leaf, unsigned at, const Beginning& from,
                               const Ray& ray, const TraceRules& rules, float far) {
  const F f;
  const TraceDiscs& discs = leaf.discs[at / kTraceLanes];
  const auto load = [&](const float* column) { return hn::Load(f, column + at % kTraceLanes); };
  const Vec along = spread(ray.along);
  const Vec to{hn::Sub(load(discs.x), hn::Set(f, from.at[0])),
               hn::Sub(load(discs.y), hn::Set(f, from.at[1])),
               hn::Sub(load(discs.z), hn::Set(f, from.at[2]))};
  const Vec normal{load(discs.nx), load(discs.ny), load(discs.nz)};
  const auto height = dot(to, normal), radius2 = load(discs.radius2);
  const auto t = hn::Div(height, dot(normal, along));
  const Vec off{hn::MulSub(along.x, t, to.x), hn::MulSub(along.y, t, to.y),
                hn::MulSub(along.z, t, to.z)};
  const auto off2 = dot(off, off);
  const auto depth = hn::MulAdd(load(discs.bump), off2, t);
  auto met = hn::And(hn::Le(off2, radius2), hn::Gt(t, hn::Zero(f)));
  met = hn::And(met, hn::Le(depth, hn::Set(f, far)));
  const float reach = rules.clear_backs / rules.rim;
  const auto clear = hn::And(hn::Ge(height, hn::Zero(f)),
                             hn::Lt(dot(to, to), hn::Mul(hn::Set(f, reach * reach), radius2)));
  return {depth, height, hn::And(hn::AndNot(clear, met), hn::FirstN(f, leaf.size - at))};
}

/// Tests the discs of a leaf.
/// @param first  number of its first point
/// @return       whether the ray met one that is nearer than `hit`, which it replaces
HWY_INLINE bool meet_nearest(const TraceLeaf& leaf, std::uint64_t first, const Beginning& from,
                             const Ray& ray, const TraceRules& rules, RaysFor wanted, RayHit& hit) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  bool met = false;
  for (unsigned at = 0; at < leaf.size; at += lanes) {
    const MetDiscs discs = meet_discs(leaf, at, from, ray, rules, hit.depth);
    unsigned bits = bits_of(f, discs.met);
    if (bits == 0) continue;
    alignas(64) float depths[kTraceLanes], heights[kTraceLanes];
    hn::Store(discs.depth, f, depths);
    hn::Store(discs.height, f, heights);
    for (; bits != 0; bits &= bits - 1) {
      const auto i = static_cast<unsigned>(std::countr_zero(bits));
      // Of discs at one depth take that of the first point, in whichever order they are met
      const std::uint64_t point = first + at + i;
      if (depths[i] > hit.depth || (depths[i] == hit.depth && point > hit.point)) continue;
      hit = {depths[i], heights[i] >= 0, point};
      met = true;
      if (wanted == RaysFor::any) return true;
    }
  }
  return met;
}

/// Tests whether a ray meets a disc of a leaf within `length`.
HWY_INLINE bool meet_any(const TraceLeaf& leaf, const Beginning& from, const Ray& ray,
                         const TraceRules& rules, float length) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  for (unsigned at = 0; at < leaf.size; at += lanes) {
    if (!hn::AllFalse(f, meet_discs(leaf, at, from, ray, rules, length).met)) return true;
  }
  return false;
}

/// A node that a ray has yet to look into.
struct Waiting {
  std::uint64_t reference;
  float near;  ///< depth at which the ray enters its box
  bool interior;
};

/// The nodes that a ray has yet to look into, the nearest on top.
class Stack {
 public:
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] bool has_room() const noexcept { return size_ + kTraceLanes <= kRoom; }
  Waiting pop() noexcept { return items_[--size_]; }
  /// Begins to push siblings.
  void begin() noexcept { floor_ = size_; }
  /// Pushes a sibling below those that are nearer.
  void push(const Waiting& item) noexcept {
    std::size_t at = size_++;
    for (; at > floor_ && items_[at - 1].near < item.near; --at) items_[at] = items_[at - 1];
    items_[at] = item;
  }

 private:
  /// A path has a group for each level at most, each of which leaves 7 siblings behind.
  static constexpr std::size_t kRoom = std::size_t{kMaxLevel + 2} * kTraceLanes;

  std::size_t size_ = 0, floor_ = 0;
  Waiting items_[kRoom];
};

/// Follows one ray.
/// @param place       where the ray begins, lattice units
/// @param meet_listed tests kTraceLanes boxes of the list: meet_listed(number of the first, near)
/// @param far         returns the depth beyond which the ray looks for nothing
/// @param meet_leaf   looks at up to kTraceDiscs points, and returns whether the ray ends there:
///                    meet_leaf(leaf, number of its first point)
template <class MeetListed, class Far, class MeetLeaf>
HWY_INLINE void follow(DecodedTree& tree, const BoxList& list, std::span<const std::uint64_t> words,
                       const Ray& ray, const glm::dvec3& place, const MeetListed& meet_listed,
                       const Far& far, const MeetLeaf& meet_leaf) {
  Stack stack;
  WalkLimit limit(tree.view());
  alignas(64) float near[kTraceLanes];
  for (std::size_t at = 0;;) {
    // Take the next boxes of the list
    if (stack.empty()) {
      if (at >= list.size || list.distance[at] > far()) return;
      unsigned bits = meet_listed(at, near) & ((1U << std::min(list.size - at, kTraceLanes)) - 1);
      stack.begin();
      for (; bits != 0; bits &= bits - 1) {
        const auto i = static_cast<unsigned>(std::countr_zero(bits));
        const std::uint32_t number = list.number[at + i];
        stack.push({words[number >> 1], near[i], (number & 1) != 0});
      }
      at += kTraceLanes;
      continue;
    }
    const Waiting next = stack.pop();
    if (next.near > far()) continue;
    // Look at the children of a group
    if (next.interior) {
      limit.take_group();
      if (!stack.has_room())
        tree.view().fail("spec/nodes.md#node-level",
                         "a path has more groups than there are levels");
      const TraceGroup& group = tree.group(next.reference);
      const Beginning from(place, group.anchor);
      unsigned bits =
          meet_boxes<true>(group.columns[0], kTraceLanes, ray, &from, far(), near) & group.children;
      stack.begin();
      for (; bits != 0; bits &= bits - 1) {
        const auto i = static_cast<unsigned>(std::countr_zero(bits));
        stack.push({group.child[i], near[i], (group.interior >> i & 1) != 0});
      }
      continue;
    }
    // Look at the points of a leaf
    const ChildRef leaf = decode_reference(next.reference, false);
    limit.take_points(leaf.point_count);
    for (std::uint32_t done = 0; done < leaf.point_count; done += kTraceDiscs) {
      const std::uint64_t first = leaf.first_point + done;
      const auto count = std::min<std::uint32_t>(leaf.point_count - done, kTraceDiscs);
      if (meet_leaf(tree.leaf(first, count), first)) return;
    }
  }
}

}  // namespace

bool has_disc(const TraceLeaf& leaf, const Beginning& from, const glm::vec3& axis,
              const TraceRules& rules) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  const Vec up = spread(axis);
  for (unsigned at = 0; at < leaf.size; at += lanes) {
    const TraceDiscs& discs = leaf.discs[at / kTraceLanes];
    const auto load = [&](const float* column) { return hn::Load(f, column + at % kTraceLanes); };
    const Vec to{hn::Sub(load(discs.x), hn::Set(f, from.at[0])),
                 hn::Sub(load(discs.y), hn::Set(f, from.at[1])),
                 hn::Sub(load(discs.z), hn::Set(f, from.at[2]))};
    const Vec normal{load(discs.nx), load(discs.ny), load(discs.nz)};
    const auto radius2 = load(discs.radius2);
    const auto reach2 = hn::Mul(hn::Set(f, rules.clear_backs * rules.clear_backs), radius2);
    const auto clear = hn::And(hn::Ge(dot(to, normal), hn::Zero(f)), hn::Lt(dot(to, to), reach2));
    // The highest point of a disc is as far above its centre as it is tilted
    const auto cosine = dot(normal, up);
    const Vec tilt{hn::NegMulAdd(cosine, up.x, normal.x), hn::NegMulAdd(cosine, up.y, normal.y),
                   hn::NegMulAdd(cosine, up.z, normal.z)};
    const auto rise = hn::Sqrt(hn::Mul(hn::Max(radius2, hn::Zero(f)), dot(tilt, tilt)));
    const auto size = hn::Add(rise, hn::Add(hn::Abs(to.x), hn::Add(hn::Abs(to.y), hn::Abs(to.z))));
    const auto top = hn::MulAdd(hn::Set(f, kTraceRounding), size,
                                hn::Add(hn::Add(dot(to, up), rise), hn::Set(f, from.slack)));
    const auto seen = hn::AndNot(clear, hn::Gt(top, hn::Zero(f)));
    if (!hn::AllFalse(
            f, hn::And(hn::And(seen, hn::Ge(radius2, hn::Zero(f))), hn::FirstN(f, leaf.size - at))))
      return true;
  }
  return false;
}

void narrow_boxes(const BoxList& from, std::span<const glm::vec3> directions, BoxList& into) {
  // Bound the directions on each axis, turned so that they do not descend
  const F f;
  const U u;
  struct Axis {
    bool used;
    bool turned;
    float slow, fast;  ///< 1 over the least and the greatest component
  };
  std::array<Axis, 3> axes;
  for (int k = 0; k < 3; ++k) {
    float low = 1, high = -1;
    for (const glm::vec3& d : directions) {
      low = std::min(low, d[k]);
      high = std::max(high, d[k]);
    }
    const bool turned = high <= 0;
    if (turned) std::swap(low = -low, high = -high);
    axes[static_cast<std::size_t>(k)] = {low > kLeastSlabSlope, turned, kSlack / low,
                                         1 / (kSlack * high)};
  }
  // Keep the boxes that such directions may meet
  into.size = 0;
  for (std::size_t at = 0; at < from.size; at += hn::Lanes(f)) {
    auto enter = hn::Zero(f), leave = hn::Set(f, kFarAway);
    for (std::size_t k = 0; k < 3; ++k) {
      const Axis& axis = axes[k];
      if (!axis.used) continue;
      auto low = hn::LoadU(f, from.columns[kLowX + k] + at),
           high = hn::LoadU(f, from.columns[kHighX + k] + at);
      if (axis.turned) {
        const auto turned = hn::Neg(low);
        low = hn::Neg(high);
        high = turned;
      }
      const auto slow = hn::Set(f, axis.slow), fast = hn::Set(f, axis.fast);
      const auto positive = [&](VF v) { return hn::Gt(v, hn::Zero(f)); };
      enter = hn::Max(enter, hn::Mul(low, hn::IfThenElse(positive(low), fast, slow)));
      leave = hn::Min(leave, hn::Mul(high, hn::IfThenElse(positive(high), slow, fast)));
    }
    const auto kept = hn::And(hn::Le(enter, leave), hn::FirstN(f, from.size - at));
    if (hn::AllFalse(f, kept)) continue;
    for (std::size_t k = 0; k < kBoxColumns; ++k)
      append(hn::LoadU(f, from.columns[k] + at), kept, f, into.columns[k] + into.size);
    append(hn::LoadU(f, from.distance + at), kept, f, into.distance + into.size);
    into.size +=
        append(hn::LoadU(u, from.number + at), hn::RebindMask(u, kept), u, into.number + into.size);
  }
}

void trace_rays(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                std::span<const std::uint64_t> words, std::span<const glm::vec3> directions,
                RaysFor wanted, std::span<RayHit> hits) {
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const Ray ray(directions[i]);
    RayHit& hit = hits[i];
    follow(
        tree, list, words, ray, place,
        [&](std::size_t at, float* near) {
          return meet_boxes<false>(list.columns[0] + at, BoxList::kStride, ray, nullptr, hit.depth,
                                   near);
        },
        [&] { return hit.depth; },
        [&](const TraceLeaf& leaf, std::uint64_t first) {
          const Beginning from(place, leaf.anchor);
          return meet_nearest(leaf, first, from, ray, tree.rules(), wanted, hit) &&
                 wanted == RaysFor::any;
        });
  }
}

void trace_shadows(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                   std::span<const std::uint64_t> words, std::span<const ShadowRay> rays,
                   std::span<const std::uint32_t> chosen, std::span<std::uint8_t> hidden) {
  for (const std::uint32_t i : chosen) {
    const Ray ray(rays[i].direction);
    const glm::dvec3 begin = place + glm::dvec3(rays[i].origin) / SceneScale::kLatticeUnit;
    const Beginning beside(begin, place);
    const float length = rays[i].length;
    hidden[i] = 0;
    follow(
        tree, list, words, ray, begin,
        [&](std::size_t at, float* near) {
          return meet_boxes<true>(list.columns[0] + at, BoxList::kStride, ray, &beside, length,
                                  near);
        },
        [&] { return length; },
        [&](const TraceLeaf& leaf, std::uint64_t /*first*/) {
          if (!meet_any(leaf, Beginning(begin, leaf.anchor), ray, tree.rules(), length))
            return false;
          hidden[i] = 1;
          return true;
        });
  }
}

unsigned meet_shaft(const TraceGroup& group, const Beginning& from, const Shaft& shaft,
                    float* near) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  const Vec axes[3] = {spread(shaft.axes[0]), spread(shaft.axes[1]), spread(shaft.axes[2])};
  unsigned met = 0;
  for (unsigned first = 0; first < kTraceLanes; first += lanes) {
    // Project the boxes on the axes of the shaft
    VF middle[3], half[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto low = hn::Load(f, group.columns[kLowX + k] + first),
                 high = hn::Load(f, group.columns[kHighX + k] + first);
      middle[k] = hn::MulSub(hn::Set(f, 0.5F), hn::Add(low, high), hn::Set(f, from.at[k]));
      half[k] = hn::MulAdd(hn::Set(f, 0.5F), hn::Sub(high, low), hn::Set(f, from.slack));
    }
    VF low[3], high[3];
    for (int k = 0; k < 3; ++k) {
      const Vec& axis = axes[k];
      const auto at = dot({middle[0], middle[1], middle[2]}, axis);
      const auto reach = hn::Mul(
          dot({half[0], half[1], half[2]}, {hn::Abs(axis.x), hn::Abs(axis.y), hn::Abs(axis.z)}),
          hn::Set(f, kSlack));
      low[k] = hn::Sub(at, reach);
      high[k] = hn::Add(at, reach);
    }
    // Compare them with the shaft between the depths at which it passes each box
    const auto enter = hn::Max(hn::Zero(f), hn::Sub(low[2], hn::Set(f, shaft.high[2])));
    const auto leave = hn::Sub(high[2], hn::Set(f, shaft.low[2]));
    auto kept = hn::And(hn::Ge(leave, hn::Zero(f)), hn::Le(enter, hn::Set(f, shaft.depth)));
    for (int k = 0; k < 2; ++k) {
      const auto slope_low = hn::Set(f, shaft.slope_low[k]),
                 slope_high = hn::Set(f, shaft.slope_high[k]);
      const auto least = hn::Add(hn::Set(f, shaft.low[k]),
                                 hn::Min(hn::Mul(slope_low, enter), hn::Mul(slope_low, leave))),
                 most = hn::Add(hn::Set(f, shaft.high[k]),
                                hn::Max(hn::Mul(slope_high, enter), hn::Mul(slope_high, leave)));
      kept = hn::And(kept, hn::And(hn::Le(low[k], most), hn::Ge(high[k], least)));
    }
    hn::StoreU(enter, f, near + first);
    met |= bits_of(f, kept) << first;
  }
  return met & group.children;
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(has_disc);
HWY_EXPORT(narrow_boxes);
HWY_EXPORT(trace_rays);
HWY_EXPORT(trace_shadows);
HWY_EXPORT(meet_shaft);

bool has_disc(const TraceLeaf& leaf, const Beginning& from, const glm::vec3& axis,
              const TraceRules& rules) {
  return HWY_DYNAMIC_DISPATCH(has_disc)(leaf, from, axis, rules);
}

void narrow_boxes(const BoxList& from, std::span<const glm::vec3> directions, BoxList& into) {
  HWY_DYNAMIC_DISPATCH(narrow_boxes)(from, directions, into);
}

void trace_rays(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                std::span<const std::uint64_t> words, std::span<const glm::vec3> directions,
                RaysFor wanted, std::span<RayHit> hits) {
  HWY_DYNAMIC_DISPATCH(trace_rays)(tree, place, list, words, directions, wanted, hits);
}

void trace_shadows(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                   std::span<const std::uint64_t> words, std::span<const ShadowRay> rays,
                   std::span<const std::uint32_t> chosen, std::span<std::uint8_t> hidden) {
  HWY_DYNAMIC_DISPATCH(trace_shadows)(tree, place, list, words, rays, chosen, hidden);
}

unsigned meet_shaft(const TraceGroup& group, const Beginning& from, const Shaft& shaft,
                    float* near) {
  return HWY_DYNAMIC_DISPATCH(meet_shaft)(group, from, shaft, near);
}

}  // namespace ptc
#endif
