// The pixels that discs are drawn on, a vector at a time. The file is included by a file that is
// compiled once for each instruction set, so it is guarded once for each instruction set.
//
// Covering keeps the greatest nearness of each pixel, and of equal ones the least colour. Minimum
// and maximum do not depend on order, so neither does the picture, whatever the order in which
// threads, pages and queues bring the discs. The viewpoint in the lowest 4 bits of the nearness
// takes part in the comparison; it changes a nearness by at most 2^-19 of it.
#if defined(PTC_SHADE_CANVAS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SHADE_CANVAS_INL_H
#undef PTC_SHADE_CANVAS_INL_H
#else
#define PTC_SHADE_CANVAS_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "engine/shade/kernels/direction_kernels.h"
#include "engine/shade/kernels/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

constexpr int kLanes = DiscQueue::kReadLanes;
using F = hn::CappedTag<float, kLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;
using VF = hn::VFromD<F>;
using VU = hn::VFromD<U>;
using MF = hn::Mask<F>;

/// The pixels of a cube as they are drawn on from one viewpoint.
template <bool kColoured>
class Canvas {
 public:
  Canvas(const CubeGeometry& geometry, const CubePixels& pixels, unsigned viewpoint)
      : cube(geometry), pixels_(pixels), viewpoint_(hn::Set(U(), viewpoint)) {}

  /// Covers a vector of pixels.
  /// @param at      index of the first one
  /// @param near    nearness of the disc at each; one below 0 covers nothing
  /// @param inside  pixels whose ray meets the disc
  HWY_INLINE void cover(std::ptrdiff_t at, VF near, MF inside, VU colour) const {
    // Put the number of the viewpoint into the lowest bits.
    const F f;
    const U u;
    near = hn::BitCast(
        f, hn::Or(hn::AndNot(hn::Set(u, kViewpoints - 1U), hn::BitCast(u, near)), viewpoint_));
    // Take the disc where it is nearer than what is there.
    float* nearness = pixels_.nearness + at;
    const auto old_near = hn::LoadU(f, nearness);
    if constexpr (kColoured) {
      std::uint32_t* rgbe = pixels_.rgbe + at;
      const auto old_colour = hn::LoadU(u, rgbe);
      const auto tie =
          hn::And(hn::Eq(near, old_near), hn::RebindMask(f, hn::Lt(colour, old_colour)));
      const auto take = hn::And(inside, hn::Or(hn::Gt(near, old_near), tie));
      hn::StoreU(hn::IfThenElse(take, near, old_near), f, nearness);
      hn::StoreU(hn::IfThenElse(hn::RebindMask(u, take), colour, old_colour), u, rgbe);
    } else {
      hn::StoreU(hn::IfThenElse(inside, hn::Max(near, old_near), old_near), f, nearness);
    }
  }

  const CubeGeometry& cube;

 private:
  CubePixels pixels_;
  VU viewpoint_;
};

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
