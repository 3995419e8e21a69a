// What gathering clusters and gathering surfels have in common, a lane each. Included by files that
// are compiled once per instruction set, so it is guarded once per instruction set.
#if defined(PTC_SHADE_GATHER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SHADE_GATHER_INL_H
#undef PTC_SHADE_GATHER_INL_H
#else
#define PTC_SHADE_GATHER_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "engine/shade/kernels/gather_kernels.h"
#include "engine/shade/kernels/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

using F = hn::CappedTag<float, DiscQueue::kLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;
using U16 = hn::Rebind<std::uint16_t, F>;
using I16 = hn::Rebind<std::int16_t, F>;
using F16 = hn::Rebind<hwy::float16_t, F>;
using VF = hn::VFromD<F>;
using VU = hn::VFromD<U>;
using MF = hn::Mask<F>;

constexpr float kSeam = 0.5F;  // width of a seam in units of rho / h

HWY_INLINE VU load_u16(const std::byte* at) {
  return hn::PromoteTo(U(), hn::LoadU(U16(), reinterpret_cast<const std::uint16_t*>(at)));
}
HWY_INLINE VF to_float(VU v) {
  return hn::ConvertTo(F(), hn::BitCast(I(), v));
}
HWY_INLINE VF load_ufloat16(const std::byte* at) {
  return hn::BitCast(F(), hn::ShiftLeft<15>(load_u16(at)));
}

struct Vec {
  VF x, y, z;
};
HWY_INLINE VF dot(const Vec& a, const Vec& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE Vec spread(const glm::vec3& v) {
  return {hn::Set(F(), v.x), hn::Set(F(), v.y), hn::Set(F(), v.z)};
}
HWY_INLINE Vec scaled(const Vec& v, VF by) {
  return {hn::Mul(v.x, by), hn::Mul(v.y, by), hn::Mul(v.z, by)};
}

/// A number on [-1, 1] squared unfolded into a unit vector (format/scalar.cpp).
HWY_INLINE Vec unfold(VF u, VF v) {
  const F f;
  const auto one = hn::Set(f, 1.0F);
  const auto z = hn::Sub(one, hn::Add(hn::Abs(u), hn::Abs(v)));
  const auto lower = hn::Lt(z, hn::Zero(f));
  const auto x = hn::IfThenElse(lower, hn::CopySign(hn::Sub(one, hn::Abs(v)), u), u);
  const auto y = hn::IfThenElse(lower, hn::CopySign(hn::Sub(one, hn::Abs(u)), v), v);
  const Vec n{x, y, z};
  return scaled(n, hn::Div(one, hn::Sqrt(dot(n, n))));
}

/// As encode_rgbe(), but a component that rounds up to 256 stays 255.
HWY_INLINE VU pack_rgbe(VF r, VF g, VF b) {
  const F f;
  const I i;
  const U u;
  const auto greatest = hn::Max(r, hn::Max(g, b));
  // 2^e > greatest: the exponent field of a float is e + 126.
  const auto field = hn::ShiftRight<23>(hn::BitCast(u, greatest));
  const auto exponent = hn::BitCast(i, hn::Add(field, hn::Set(u, 2U)));  // e + 128
  const auto scale =
      hn::BitCast(f, hn::ShiftLeft<23>(hn::Sub(hn::Set(i, 263), exponent)));  // 2^(8 - e)
  const auto byte = [&](VF c) {
    return hn::BitCast(
        u, hn::ConvertTo(i, hn::Min(hn::MulAdd(c, scale, hn::Set(f, 0.5F)), hn::Set(f, 255.0F))));
  };
  const auto packed =
      hn::Or(hn::Or(byte(r), hn::ShiftLeft<8>(byte(g))),
             hn::Or(hn::ShiftLeft<16>(byte(b)), hn::ShiftLeft<24>(hn::BitCast(u, exponent))));
  // Below 2^-100 nothing is bright enough to see, and the scale would overflow.
  return hn::IfThenElseZero(hn::RebindMask(u, hn::Gt(greatest, hn::Set(f, 0x1p-100F))), packed);
}

HWY_INLINE MF mask_of(unsigned bits) {
  const U u;
  alignas(64) static constexpr std::uint32_t kBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
  return hn::RebindMask(F(), hn::TestBit(hn::Set(u, bits), hn::LoadU(u, kBit)));
}

/// Appends the lanes of a mask.
HWY_INLINE void push(DiscQueue& queue, MF mask, const Vec& to, const Vec& normal, VF radius,
                     VU rgbe) {
  const F f;
  const U u;
  const auto at = static_cast<std::size_t>(queue.size);
  append(to.x, mask, f, queue.x + at);
  append(to.y, mask, f, queue.y + at);
  append(to.z, mask, f, queue.z + at);
  append(normal.x, mask, f, queue.nx + at);
  append(normal.y, mask, f, queue.ny + at);
  append(normal.z, mask, f, queue.nz + at);
  append(radius, mask, f, queue.radius + at);
  queue.size += static_cast<int>(append(rgbe, hn::RebindMask(u, mask), u, queue.rgbe + at));
}

/// Of lengths relative to a cell, over them: what floats may be off after a few operations.
constexpr float kRounding = 4e-7F;

/// How high the direction to a thing reaches over the horizon of any receiver of the cell, as a
/// length: to . n at its greatest over the normals of the cone, how far receivers lie below the
/// centre, and what rounding may take from both.
/// @param along  to . axis
HWY_INLINE VF highest(const ReceiverCell& cell, VF distance2, VF along) {
  const F f;
  const auto across = hn::Sqrt(hn::Max(hn::NegMulAdd(along, along, distance2), hn::Zero(f)));
  const auto turned =
      hn::MulAdd(hn::Set(f, cell.cone_cos), along, hn::Mul(hn::Set(f, cell.cone_sin), across));
  // Inside the cone the greatest is the distance itself.
  const auto inside =
      hn::Gt(hn::Mul(hn::Set(f, cell.cone_sin), along), hn::Mul(hn::Set(f, cell.cone_cos), across));
  const auto distance = hn::Sqrt(distance2);
  const auto below =
      hn::MulAdd(distance, hn::Set(f, kRounding), hn::Set(f, cell.depth * (1 + kRounding)));
  return hn::Add(hn::IfThenElse(inside, distance, turned), below);
}

/// Half the extent of a slab along any normal of the cone: at most `thick` along the slab's normal
/// and `wide` across it.
/// @param cosine  of the angle between the slab's normal and the cone's axis
HWY_INLINE VF max_rise(const ReceiverCell& cell, VF cosine, VF thick, VF wide) {
  const F f;
  const auto sine = hn::Sqrt(hn::Max(hn::NegMulAdd(cosine, cosine, hn::Set(f, 1.0F)), hn::Zero(f)));
  const auto cone_cos = hn::Set(f, cell.cone_cos), cone_sin = hn::Set(f, cell.cone_sin);
  auto tilt = hn::MulAdd(sine, cone_cos, hn::Mul(hn::Abs(cosine), cone_sin));
  const auto edge_on =
      hn::Lt(hn::Mul(hn::Abs(cosine), cone_cos), hn::Mul(sine, cone_sin));  // to some normal
  tilt = hn::IfThenElse(edge_on, hn::Set(f, 1.0F), tilt);
  return hn::MulAdd(wide, tilt, thick);
}

/// Distance up to which the children of a cell draw what the cell draws too
/// (spec/shading.md#seams).
/// @param height  of the cell's centre over the plane of the thing, not negative
/// @param above   how far the thing's top stands over the horizon of the centre; d its distance
HWY_INLINE VF seam_end(const CellTest& test, VF height, VF above, VF d) {
  const F f;
  const auto one = hn::Set(f, 1.0F);
  auto share = hn::Min(hn::Div(hn::Set(f, kSeam * test.cell.radius), height), one);
  if (test.cell.has_horizon)
    share = hn::Mul(share, hn::Max(hn::Zero(f), hn::Min(hn::Div(above, d), one)));
  return hn::MulAdd(share, hn::Set(f, test.shared_from), hn::Set(f, test.shared_from));
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
