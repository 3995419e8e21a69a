// Decodes groups and leaves into the boxes and discs that rays meet.
//
// A box is what the sphere, the slab and the octant of a child have in common, widened by what
// rounding may take from it. Points become columns of discs, kTraceLanes after kTraceLanes.
#include "engine/trace/decode_kernels.h"

#include <algorithm>
#include <array>

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/trace/decode_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/gather-inl.h"
#include "format/node_layout.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

void decode_boxes(const GroupView& group, const TraceRules& rules, TraceGroup& into) {
  const F f;
  const auto children = static_cast<unsigned>(group.size());
  into.children = (1U << children) - 1;
  into.interior = group.interior_mask();
  for (unsigned i = 0; i < children; ++i) into.child[i] = group.reference(static_cast<int>(i));
  const LatticePoint lattice = decode_morton(group.cell());
  const auto edge = static_cast<float>(cell_edge(group.level()) * SceneScale::kLatticeUnit);
  for (int k = 0; k < 3; ++k)
    into.anchor[k] = static_cast<double>(lattice[static_cast<std::size_t>(k)]);
  // Bound each child by its octant, its sphere and its slab
  const auto unit = hn::Set(f, static_cast<float>(SceneScale::kLatticeUnit)),
             most = hn::Set(f, 2 * SceneScale::kMaxRadius);
  // Mean positions above the first are in the upper octants of an axis, those below the second in
  // the lower ones
  const auto half_cell = static_cast<float>(kMeanSteps / 2);
  const float low_half = children > 1 ? half_cell : static_cast<float>(kMeanSteps),
              high_half = children > 1 ? half_cell : 0;
  for (int from = 0; from < static_cast<int>(kTraceLanes); from += static_cast<int>(hn::Lanes(f))) {
    const int at = 2 * from;
    const auto length = [&](const std::byte* column) {
      return hn::Min(hn::Mul(unit, load_ufloat16(column + at)), most);
    };
    const auto share = [&](int k) { return to_float(load_u16(group.facing(k) + at)); };
    auto radius = length(group.radius()), thickness = length(group.thickness()),
         greatest = length(group.greatest());
    // A rim is thicker than its disc only as far as that is tilted
    const auto wider = hn::Set(f, rules.rim - 1), rim = hn::Mul(greatest, wider);
    radius = hn::Add(radius, rim);
    thickness = hn::MulAdd(thickness, wider, thickness);
    greatest = hn::Add(greatest, rim);
    Vec normal{hn::Sub(share(0), share(1)), hn::Sub(share(2), share(3)),
               hn::Sub(share(4), share(5))};
    const auto length2 = dot(normal, normal);
    const auto directed =
        hn::Gt(length2, hn::Set(f, static_cast<float>(kFacingSteps * kFacingSteps * 1e-6)));
    normal = scaled(normal, hn::Div(hn::Set(f, 1.0F), hn::Sqrt(length2)));
    normal = {hn::IfThenElse(directed, normal.x, hn::Set(f, 1.0F)),
              hn::IfThenElseZero(directed, normal.y), hn::IfThenElseZero(directed, normal.z)};
    const auto half = hn::IfThenElse(directed, thickness, radius);
    // Widen every bound by what rounding may take from it
    const auto rounding = hn::Mul(hn::Set(f, kTraceRounding),
                                  hn::Add(radius, hn::Add(greatest, hn::Set(f, 3 * edge))));
    const VF normals[3] = {normal.x, normal.y, normal.z};
    const std::byte* const means[3] = {group.mean_x(), group.mean_y(), group.mean_z()};
    VF to[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto steps = to_float(load_u16(means[k] + at));
      const auto whole = hn::Set(f, edge), part = hn::Set(f, edge / 2);
      to[k] = hn::Mul(steps, hn::Set(f, edge / static_cast<float>(kMeanSteps)));
      // Where the mean was rounded to the middle of the cell, the octant may be either. The one
      // child of a root that is a leaf has the whole cell
      const auto upper = hn::Gt(steps, hn::Set(f, low_half)),
                 lower = hn::Lt(steps, hn::Set(f, high_half));
      const auto octant_low = hn::IfThenElseZero(upper, part),
                 octant_high = hn::IfThenElse(lower, part, whole);
      // The sine between normal and axis, from the other two components, because 1 - n_k^2 cancels
      const VF n1 = normals[(k + 1) % 3], n2 = normals[(k + 2) % 3];
      const auto aside = hn::Sqrt(hn::MulAdd(n1, n1, hn::Mul(n2, n2)));
      const auto reach =
          hn::Min(radius, hn::MulAdd(half, hn::Abs(normals[k]), hn::Mul(radius, aside)));
      const auto low = hn::Max(hn::Sub(to[k], reach), hn::Sub(octant_low, greatest)),
                 high = hn::Min(hn::Add(to[k], reach), hn::Add(octant_high, greatest));
      hn::StoreU(hn::Sub(low, rounding), f, into.columns[kLowX + k] + from);
      hn::StoreU(hn::Add(high, rounding), f, into.columns[kHighX + k] + from);
      hn::StoreU(normals[k], f, into.columns[kSlabX + k] + from);
    }
    const auto along = dot({to[0], to[1], to[2]}, normal), reach = hn::Add(half, rounding);
    hn::StoreU(hn::Sub(along, reach), f, into.columns[kSlabLow] + from);
    hn::StoreU(hn::Add(along, reach), f, into.columns[kSlabHigh] + from);
  }
}

void decode_discs(const std::byte* payload, std::uint32_t count, std::uint32_t first,
                  unsigned number, unsigned from, const TraceRules& rules, TraceLeaf& into) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  for (unsigned done = 0; done < number; done += lanes) {
    const PageSurfels s = load_surfels(payload, count, first + done, into.anchor, rules.lengths);
    const auto radius = hn::Mul(s.radius, hn::Set(f, rules.rim));
    const auto exists = hn::Gt(radius, hn::Zero(f));
    const VF values[] = {s.to.x,
                         s.to.y,
                         s.to.z,
                         s.normal.x,
                         s.normal.y,
                         s.normal.z,
                         hn::IfThenElse(exists, hn::Mul(radius, radius), hn::Set(f, -1.0F)),
                         hn::Div(hn::Set(f, kBump), s.radius)};
    const auto columns = [&](unsigned at) {
      TraceDiscs& discs = into.discs[at / kTraceLanes];
      return std::array{discs.x,  discs.y,  discs.z,       discs.nx,
                        discs.ny, discs.nz, discs.radius2, discs.bump};
    };
    const unsigned to = from + done;
    if (to % lanes == 0) {
      const std::array<float*, 8> begin = columns(to);
      for (std::size_t k = 0; k < begin.size(); ++k)
        hn::Store(values[k], f, begin[k] + to % kTraceLanes);
      continue;
    }
    // A run that goes on from one page to the next does so anywhere
    for (std::size_t k = 0; k < std::size(values); ++k) {
      alignas(64) float column[kTraceLanes];
      hn::Store(values[k], f, column);
      for (unsigned i = 0; i < std::min(number - done, lanes); ++i)
        columns(to + i)[k][(to + i) % kTraceLanes] = column[i];
    }
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(decode_boxes);
HWY_EXPORT(decode_discs);

void decode_boxes(const GroupView& group, const TraceRules& rules, TraceGroup& into) {
  HWY_DYNAMIC_DISPATCH(decode_boxes)(group, rules, into);
}

void decode_discs(const std::byte* payload, std::uint32_t count, std::uint32_t first,
                  unsigned number, unsigned from, const TraceRules& rules, TraceLeaf& into) {
  HWY_DYNAMIC_DISPATCH(decode_discs)(payload, count, first, number, from, rules, into);
}

}  // namespace ptc
#endif
