// Decides what becomes of surfels: drop, draw or keep (gather_kernels.h). A surfel is a disc, and
// the distance that counts is that of its nearest point, because a receiver that stands over a disc
// sees it change with every step, however far away its middle is:
//
//            x centre of the cell
//            |\                        height = |to . n|      over the plane of the disc
//            | \  d                    aside^2 = |to|^2 - height^2
//     height |  \                      beyond = max(aside - radius, 0)
//            |   \                     d^2 = beyond^2 + height^2
//            +----=======o=======
//            beyond      radius        o is the middle, at `aside` from the foot of the height
//
// The back of a disc is clear to receivers within two radii of its middle. Where that holds for
// some receivers of a cell and not for others, the disc is kept, however far it is.
//
// The two sides of a sheet are discs at nearly one place, and the depths that decide between them
// are seen from the cell's centre where a cell draws, and from the receiver where that does. So a
// front is drawn wherever the back behind it may be drawn: with what is a little farther away, and
// both by the cell and by the receiver where the back's being clear is left to the receiver.
//
// Surfels come from a page in columns (spec/points.md#point-page), or from the lists that the
// enclosing cell left. Coordinates of a page are 42-bit lattice numbers, more than a float holds,
// so the centre is taken off in integers first.
#include <algorithm>
#include <cmath>

#include "engine/shade/kernels/gather_kernels.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/kernels/gather_surfels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/gather-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

/// Bound of how much farther away the other side of a sheet may be, in radii: twice 0.02, and some.
/// It counts up to a tenth of the distance, so that what lies just below a receiver stays near.
constexpr float kSheetDepth = 0.05F;
/// Bound of how far the two sides of a sheet differ in distances of two radii, in radii.
constexpr float kSheetSlack = 0.2F;

/// Draws, keeps or drops surfels.
/// @param wanted  surfels to look at
/// @param colour  returns their RGBE; is called only when it is needed
template <class Colour>
HWY_INLINE void settle(const CellTest& test, const PageSurfels& s, MF wanted, const Colour& colour,
                       CellOutput& out) {
  // Drop what lies under every horizon, and backs where none counts.
  const F f;
  const U u;
  const ReceiverCell& cell = test.cell;
  const Vec axis = spread(cell.axis);
  const auto d2 = dot(s.to, s.to);
  wanted = hn::And(wanted, hn::Gt(s.radius, hn::Zero(f)));
  if (cell.has_horizon) {
    const auto rise = hn::Min(max_rise(cell, dot(s.normal, axis), hn::Zero(f), s.radius), s.radius);
    wanted =
        hn::And(wanted, hn::Gt(hn::Add(highest(cell, d2, dot(s.to, axis)), rise), hn::Zero(f)));
  }
  const auto height = dot(s.to, s.normal);
  if (test.sides == Sides::front) wanted = hn::And(wanted, hn::Lt(height, hn::Set(f, cell.radius)));
  if (hn::AllFalse(f, wanted)) return;
  // Draw what is far enough, by the distance of the disc's nearest point.
  const auto aside = hn::Sqrt(hn::Max(hn::NegMulAdd(height, height, d2), hn::Zero(f)));
  const auto beyond = hn::Max(hn::Sub(aside, s.radius), hn::Zero(f));
  const auto d = hn::Sqrt(hn::MulAdd(beyond, beyond, hn::Mul(height, height)));
  const auto other_side =
      hn::Add(d, hn::Min(hn::Mul(hn::Set(f, kSheetDepth), s.radius), hn::Mul(hn::Set(f, 0.1F), d)));
  auto drawn = hn::And(wanted, hn::Ge(other_side, hn::Set(f, test.shared_from)));
  // Keep what is near or in the seam.
  auto keep = hn::FirstN(f, 0);
  if (!test.last) {
    const auto rho = hn::Set(f, cell.radius);
    const auto above = hn::Add(dot(s.to, axis), hn::Add(s.radius, rho));
    keep = hn::And(wanted, hn::Lt(d, seam_end(test, hn::Abs(height), above, d)));
    // Keep, and do not draw, what shows a clear back to some receivers of the cell alone.
    const auto reach = hn::Add(s.radius, s.radius), middle = hn::Sqrt(d2);
    const auto nearest = hn::Sub(middle, rho), farthest = hn::Add(middle, rho);
    const auto clear_to_some = hn::And(hn::Lt(nearest, reach), hn::Gt(height, hn::Neg(rho)));
    const auto clear_to_all = hn::And(hn::Lt(farthest, reach), hn::Gt(height, rho));
    const auto divided = hn::AndNot(clear_to_all, clear_to_some);
    drawn = hn::AndNot(divided, drawn);
    keep = hn::Or(keep, hn::And(wanted, divided));
    // Keep, and draw, fronts at about that distance: the backs behind them may be of one sheet.
    const auto front = hn::And(wanted, hn::Lt(height, hn::Zero(f)));
    const auto about = hn::AndNot(hn::Lt(farthest, hn::Mul(hn::Set(f, 2 - kSheetSlack), s.radius)),
                                  hn::Lt(nearest, hn::Mul(hn::Set(f, 2 + kSheetSlack), s.radius)));
    keep = hn::Or(keep, hn::And(front, about));
  }
  // Append to the queue and to the list.
  if (hn::AllFalse(f, hn::Or(drawn, keep))) return;
  const VU rgbe = test.bleeding ? colour() : hn::Zero(u);
  if (!hn::AllFalse(f, drawn)) push(out.queue, drawn, s.to, s.normal, s.radius, rgbe);
  if (hn::AllFalse(f, keep)) return;
  NearSurfels& left = out.left->surfels;
  left.make_room(kListLanes);
  const std::size_t at = left.size;
  append(s.to.x, keep, f, left.x.data() + at);
  append(s.to.y, keep, f, left.y.data() + at);
  append(s.to.z, keep, f, left.z.data() + at);
  append(s.normal.x, keep, f, left.nx.data() + at);
  append(s.normal.y, keep, f, left.ny.data() + at);
  append(s.normal.z, keep, f, left.nz.data() + at);
  append(s.radius, keep, f, left.radius.data() + at);
  left.size += append(rgbe, hn::RebindMask(u, keep), u, left.rgbe.data() + at);
}

}  // namespace

void gather_page_surfels(const std::byte* payload, std::uint32_t count, bool emits,
                         std::uint32_t first, unsigned number, const CellTest& test,
                         CellOutput& out) {
  const F f;
  const auto lanes = static_cast<unsigned>(hn::Lanes(f));
  const std::size_t n = count;
  for (unsigned from = 0; from < number; from += lanes) {
    const std::size_t k = first + std::size_t{from};
    const PageSurfels s = load_surfels(payload, count, k, test.cell.centre, test.lengths);
    const auto half = [&](std::size_t bytes_before) {
      return hn::PromoteTo(f, hn::LoadU(F16(), reinterpret_cast<const hwy::float16_t*>(
                                                   payload + bytes_before * n + 2 * k)));
    };
    settle(
        test, s, hn::FirstN(f, number - from),
        [&] {
          if (!emits || !test.emission) return pack_rgbe(half(24), half(26), half(28));
          return pack_rgbe(hn::Add(half(24), half(34)), hn::Add(half(26), half(36)),
                           hn::Add(half(28), half(38)));
        },
        out);
  }
}

std::size_t gather_surfels(const NearSurfels& near, std::size_t from, const glm::vec3& move,
                           const CellTest& test, CellOutput& out) {
  const F f;
  const Vec moved = spread(move);
  const std::size_t lanes = hn::Lanes(f);
  for (; from < near.size && !out.queue.full(); from += lanes) {
    const auto load = [&](const std::vector<float>& column) {
      return hn::LoadU(f, column.data() + from);
    };
    const PageSurfels s{.to = {hn::Add(load(near.x), moved.x), hn::Add(load(near.y), moved.y),
                               hn::Add(load(near.z), moved.z)},
                        .normal = {load(near.nx), load(near.ny), load(near.nz)},
                        .radius = load(near.radius)};
    settle(
        test, s, hn::FirstN(f, near.size - from),
        [&] { return hn::LoadU(U(), near.rgbe.data() + from); }, out);
  }
  return std::min(from, near.size);
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(gather_page_surfels);
HWY_EXPORT(gather_surfels);

void gather_page_surfels(const std::byte* payload, std::uint32_t count, bool emits,
                         std::uint32_t first, unsigned number, const CellTest& test,
                         CellOutput& out) {
  HWY_DYNAMIC_DISPATCH(gather_page_surfels)(payload, count, emits, first, number, test, out);
}

std::size_t gather_surfels(const NearSurfels& near, std::size_t from, const glm::vec3& move,
                           const CellTest& test, CellOutput& out) {
  return HWY_DYNAMIC_DISPATCH(gather_surfels)(near, from, move, test, out);
}

}  // namespace ptc
#endif
