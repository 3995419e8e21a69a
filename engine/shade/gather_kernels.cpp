#include "engine/shade/gather_kernels.h"

#include <algorithm>
#include <cmath>

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/gather_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

using F = hn::CappedTag<float, DiscQueue::kLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;
using U16 = hn::Rebind<std::uint16_t, F>;
using I16 = hn::Rebind<std::int16_t, F>;
using F16 = hn::Rebind<hwy::float16_t, F>;
using VF = hn::VFromD<F>;
using VU = hn::VFromD<U>;
using MF = hn::Mask<F>;

constexpr float kPi = 3.14159265F;
constexpr float kSeam = 0.5F;  // width of a seam in units of rho / h

HWY_INLINE VU load_u16(const std::byte* at) {
  return hn::PromoteTo(U(), hn::LoadU(U16(), reinterpret_cast<const std::uint16_t*>(at)));
}
HWY_INLINE VF to_float(VU v) { return hn::ConvertTo(F(), hn::BitCast(I(), v)); }
HWY_INLINE VF load_ufloat16(const std::byte* at) { return hn::BitCast(F(), hn::ShiftLeft<15>(load_u16(at))); }

struct Vec {
  VF x, y, z;
};
HWY_INLINE VF dot(const Vec& a, const Vec& b) { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); }
HWY_INLINE Vec spread(const glm::vec3& v) { return {hn::Set(F(), v.x), hn::Set(F(), v.y), hn::Set(F(), v.z)}; }
HWY_INLINE Vec scaled(const Vec& v, VF by) { return {hn::Mul(v.x, by), hn::Mul(v.y, by), hn::Mul(v.z, by)}; }

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
  const auto scale = hn::BitCast(f, hn::ShiftLeft<23>(hn::Sub(hn::Set(i, 263), exponent)));  // 2^(8 - e)
  const auto byte = [&](VF c) {
    return hn::BitCast(u, hn::ConvertTo(i, hn::Min(hn::MulAdd(c, scale, hn::Set(f, 0.5F)), hn::Set(f, 255.0F))));
  };
  const auto packed = hn::Or(hn::Or(byte(r), hn::ShiftLeft<8>(byte(g))),
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
HWY_INLINE void push(DiscQueue& queue, MF mask, const Vec& to, const Vec& normal, VF radius, VU rgbe) {
  const F f;
  const U u;
  const auto at = static_cast<std::size_t>(queue.size);
  hn::CompressBlendedStore(to.x, mask, f, queue.x + at);
  hn::CompressBlendedStore(to.y, mask, f, queue.y + at);
  hn::CompressBlendedStore(to.z, mask, f, queue.z + at);
  hn::CompressBlendedStore(normal.x, mask, f, queue.nx + at);
  hn::CompressBlendedStore(normal.y, mask, f, queue.ny + at);
  hn::CompressBlendedStore(normal.z, mask, f, queue.nz + at);
  hn::CompressBlendedStore(radius, mask, f, queue.radius + at);
  queue.size += static_cast<int>(hn::CompressBlendedStore(rgbe, hn::RebindMask(u, mask), u, queue.rgbe + at));
}

/// How high the direction to a thing reaches over the horizon of any receiver of the cell, as a length:
/// to . n at its greatest over the normals of the cone, and how far receivers lie below the centre.
/// @param along  to . axis
HWY_INLINE VF highest(const ReceiverCell& cell, VF distance2, VF along) {
  const F f;
  const auto across = hn::Sqrt(hn::Max(hn::NegMulAdd(along, along, distance2), hn::Zero(f)));
  const auto turned = hn::MulAdd(hn::Set(f, cell.cone_cos), along, hn::Mul(hn::Set(f, cell.cone_sin), across));
  // Inside the cone the greatest is the distance itself.
  const auto inside = hn::Gt(hn::Mul(hn::Set(f, cell.cone_sin), along), hn::Mul(hn::Set(f, cell.cone_cos), across));
  return hn::Add(hn::IfThenElse(inside, hn::Sqrt(distance2), turned), hn::Set(f, cell.depth));
}

/// Half the extent of a slab along any normal of the cone: at most `thick` along the slab's normal and
/// `wide` across it.
/// @param cosine  of the angle between the slab's normal and the cone's axis
HWY_INLINE VF greatest_rise(const ReceiverCell& cell, VF cosine, VF thick, VF wide) {
  const F f;
  const auto sine = hn::Sqrt(hn::Max(hn::NegMulAdd(cosine, cosine, hn::Set(f, 1.0F)), hn::Zero(f)));
  const auto cone_cos = hn::Set(f, cell.cone_cos), cone_sin = hn::Set(f, cell.cone_sin);
  auto tilt = hn::MulAdd(sine, cone_cos, hn::Mul(hn::Abs(cosine), cone_sin));
  const auto edge_on = hn::Lt(hn::Mul(hn::Abs(cosine), cone_cos), hn::Mul(sine, cone_sin));  // to some normal
  tilt = hn::IfThenElse(edge_on, hn::Set(f, 1.0F), tilt);
  return hn::MulAdd(wide, tilt, thick);
}

/// Clusters all of whose surfels show their backs to every receiver.
HWY_INLINE MF faces_away(const GroupView& group, int first, const CellTest& test, const Vec& to, VF distance2, VF radius) {
  const F f;
  const I i;
  const auto cosine = hn::Mul(hn::ConvertTo(f, hn::PromoteTo(i, hn::LoadU(I16(), reinterpret_cast<const std::int16_t*>(
                                                                         group.cone_cos() + 2 * first)))),
                              hn::Set(f, 1.0F / 32767));
  const auto packed = hn::BitCast(i, load_u16(group.cone_axis() + 2 * first));
  const auto coordinate = [&](auto bits) {
    return hn::Max(hn::Mul(hn::ConvertTo(f, hn::ShiftRight<24>(bits)), hn::Set(f, 1.0F / 127)), hn::Set(f, -1.0F));
  };
  const Vec axis = unfold(coordinate(hn::ShiftLeft<24>(packed)), coordinate(hn::ShiftLeft<16>(packed)));
  const auto reach = hn::Add(radius, hn::Set(f, test.cell.radius));
  const auto clear = hn::NegMulAdd(reach, reach, distance2);
  auto sine = hn::Sqrt(hn::Max(hn::NegMulAdd(cosine, cosine, hn::Set(f, 1.0F)), hn::Zero(f)));
  sine = hn::Add(sine, hn::Set(f, 0.02F));  // the axis is rounded
  const auto least = hn::MulAdd(sine, hn::Sqrt(hn::Max(clear, hn::Zero(f))), reach);
  return hn::And(hn::And(hn::Gt(cosine, hn::Set(f, 0.05F)), hn::Gt(clear, hn::Zero(f))), hn::Gt(dot(axis, to), least));
}

/// Shares of the area that face the six axes, and what follows from them.
struct Facing {
  VF share[6];
  Vec mean;    // normal over area, not unit
  VF length;   // of the mean: 1 where all surfels face one way
  Vec normal;  // unit; NaN where the mean is zero
};

HWY_INLINE Facing load_facing(const GroupView& group, int first) {
  const F f;
  Facing facing;
  for (int k = 0; k < 6; ++k) facing.share[k] = hn::Mul(to_float(load_u16(group.facing(k) + 2 * first)), hn::Set(f, 1.0F / 65535));
  facing.mean = {hn::Sub(facing.share[0], facing.share[1]), hn::Sub(facing.share[2], facing.share[3]),
                 hn::Sub(facing.share[4], facing.share[5])};
  facing.length = hn::Sqrt(dot(facing.mean, facing.mean));
  facing.normal = scaled(facing.mean, hn::Div(hn::Set(f, 1.0F), facing.length));
  return facing;
}

/// Distance up to which the children of a cell draw what the cell draws too (spec/shading.md#seams).
/// @param height  of the cell's centre over the plane of the thing, not negative
/// @param above   how far the thing's top stands over the horizon of the centre; d its distance
HWY_INLINE VF seam_end(const CellTest& test, VF height, VF above, VF d) {
  const F f;
  const auto one = hn::Set(f, 1.0F);
  auto share = hn::Min(hn::Div(hn::Set(f, kSeam * test.cell.radius), height), one);
  if (test.cell.has_horizon) share = hn::Mul(share, hn::Max(hn::Zero(f), hn::Min(hn::Div(above, d), one)));
  return hn::MulAdd(share, hn::Set(f, test.shared_from), hn::Set(f, test.shared_from));
}

/// Clusters as discs (spec/shading.md#gather), appended to the queue.
HWY_INLINE void draw_clusters(const GroupView& group, int first, const CellTest& test, MF mask, const Vec& to,
                              VF distance, const Facing& facing, DiscQueue& queue) {
  const F f;
  const U u;
  const auto zero = hn::Zero(f);
  const auto one = hn::Set(f, 1.0F);
  const Vec toward = scaled(to, hn::Div(hn::Set(f, -1.0F), distance));
  VF light[3] = {zero, zero, zero}, sum = zero;
  const VF along_axis[3] = {toward.x, toward.y, toward.z};
  for (int axis = 0; axis < 3; ++axis) {
    const auto negative = hn::Lt(along_axis[axis], zero);
    const auto load = [&](int k) {
      return hn::LoadU(u, reinterpret_cast<const std::uint32_t*>(group.radiance(k) + 4 * first));
    };
    const UnpackedRgbe<F> rgbe =
        unpack_rgbe(f, hn::IfThenElse(hn::RebindMask(u, negative), load(2 * axis + 1), load(2 * axis)));
    const auto weight = hn::Mul(hn::Abs(along_axis[axis]),
                                hn::IfThenElse(negative, facing.share[2 * axis + 1], facing.share[2 * axis]));
    const auto scale = hn::Mul(rgbe.scale, weight);
    for (int k = 0; k < 3; ++k) light[k] = hn::MulAdd(rgbe.byte[k], scale, light[k]);
    sum = hn::Add(sum, weight);
  }
  const auto area = load_ufloat16(group.area() + 2 * first);
  // Vector area: the part that faces one way; what is left faces every way alike.
  const auto along = dot(facing.mean, toward);
  const auto scattered = hn::Mul(hn::Max(zero, hn::Sub(one, facing.length)), hn::Set(f, 0.25F));
  const auto front = hn::Add(hn::Max(zero, along), scattered);
  const auto projected = test.sides == Sides::both ? hn::Add(hn::Abs(along), scattered) : front;

  // A flat cluster is one surfel of its area and normal, which keeps surfaces tight at grazing
  // angles; any other a disc of its projected area that faces the receiver, dimmed by the backs.
  const auto flat = hn::Gt(facing.length, hn::Set(f, 0.9F));
  const auto mix = hn::IfThenElse(hn::Gt(sum, zero), hn::Div(hn::IfThenElse(flat, one, hn::Div(front, projected)), sum), zero);
  const auto seen = hn::Mul(area, hn::Mul(projected, hn::Set(f, test.inflation / kPi)));
  const auto radius = hn::Sqrt(hn::IfThenElse(flat, hn::Mul(area, hn::Set(f, 0.5F)), seen));
  const Vec disc_normal{hn::IfThenElse(flat, facing.normal.x, toward.x), hn::IfThenElse(flat, facing.normal.y, toward.y),
                        hn::IfThenElse(flat, facing.normal.z, toward.z)};
  mask = hn::And(mask, hn::Gt(hn::Mul(area, projected), zero));
  push(queue, mask, to, disc_normal, radius,
       pack_rgbe(hn::Mul(light[0], mix), hn::Mul(light[1], mix), hn::Mul(light[2], mix)));
}

}  // namespace

GroupVerdict gather_group(const GroupView& group, unsigned mask, const CellTest& test, DiscQueue& queue) {
  const F f;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const ReceiverCell& cell = test.cell;
  const LatticePoint corner = decode_morton(group.cell());
  const int level = group.level();
  const double edge = level < kLatticeBits ? static_cast<double>(std::uint64_t{1} << (kLatticeBits - level)) : 1.0;
  const auto step = hn::Set(f, static_cast<float>(edge * test.unit / 65536));
  const auto offset = [&](std::size_t k, double centre) {
    return hn::Set(f, static_cast<float>((static_cast<double>(corner[k]) - centre) * test.unit));
  };
  const Vec base{offset(0, cell.centre.x), offset(1, cell.centre.y), offset(2, cell.centre.z)};
  const auto unit = hn::Set(f, static_cast<float>(test.unit));
  const auto limit = hn::Set(f, test.limit);
  const auto rho = hn::Set(f, cell.radius);
  const auto shared_from = hn::Set(f, test.shared_from);
  const Vec axis = spread(cell.axis);

  GroupVerdict verdict;
  mask &= (1U << group.size()) - 1;
  for (int first = 0; first < group.size(); first += lanes) {
    auto wanted = mask_of(mask >> first);
    const int at = 2 * first;
    const Vec to{hn::MulAdd(step, to_float(load_u16(group.mean_x() + at)), base.x),
                 hn::MulAdd(step, to_float(load_u16(group.mean_y() + at)), base.y),
                 hn::MulAdd(step, to_float(load_u16(group.mean_z() + at)), base.z)};
    const auto r = hn::Mul(unit, load_ufloat16(group.radius() + at));
    const auto d2 = dot(to, to);
    const Facing facing = load_facing(group, first);
    if (cell.has_horizon) {
      // What lies in the sphere and in the slab; of a mean normal of zero, NaN, the sphere alone.
      const auto thick = hn::Mul(unit, load_ufloat16(group.thickness() + at));
      auto rise = greatest_rise(cell, dot(facing.normal, axis), thick, r);
      rise = hn::IfThenElse(hn::Lt(rise, r), rise, r);
      wanted = hn::And(wanted, hn::Gt(hn::Add(highest(cell, d2, dot(to, axis)), rise), hn::Zero(f)));
    }
    if (test.sides == Sides::front) wanted = hn::AndNot(faces_away(group, first, test, to, d2, r), wanted);
    if (hn::AllFalse(f, wanted)) continue;
    const auto d = hn::Sqrt(d2);
    const auto nearest = hn::Max(hn::Zero(f), hn::Sub(d, rho));
    const auto r2 = hn::Mul(r, r);
    const auto small = hn::Lt(r2, hn::Mul(limit, hn::Mul(nearest, nearest)));  // for every receiver
    const auto settled = hn::Ge(d, shared_from);
    const auto drawn = hn::And(wanted, hn::And(small, settled));
    if (!hn::AllFalse(f, drawn)) draw_clusters(group, first, test, drawn, to, d, facing, queue);
    const auto large = hn::AndNot(small, wanted);
    if (test.last) {
      verdict.open |= bits_of(f, large) << first;
      continue;
    }
    // Open now what the children would open anyway, or what opens into shared parts.
    const auto farthest = hn::Add(d, rho);
    const auto opens = hn::Or(hn::Ge(hn::Sub(d, r), shared_from),
                              hn::Ge(r2, hn::Mul(limit, hn::Mul(farthest, farthest))));
    // Of what faces many ways, some part is always seen from the front.
    const auto scattered = hn::Mul(d, hn::Max(hn::Sub(hn::Set(f, 1.0F), facing.length), hn::Zero(f)));
    const auto above = hn::Add(dot(to, axis), hn::Add(r, rho));
    const auto band = hn::Lt(d, seam_end(test, hn::Max(hn::Abs(dot(to, facing.mean)), scattered), above, d));
    verdict.open |= bits_of(f, hn::And(large, opens)) << first;
    verdict.keep |= bits_of(f, hn::Or(hn::AndNot(opens, large), hn::And(wanted, hn::And(small, band)))) << first;
  }
  return verdict;
}

unsigned gather_surfels(const std::byte* payload, std::uint32_t count, std::uint32_t first, unsigned mask,
                        const CellTest& test, DiscQueue& queue) {
  const F f;
  const I i;
  const U u;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  const ReceiverCell& cell = test.cell;
  const std::size_t n = count;
  const Vec axis = spread(cell.axis);
  unsigned keep = 0;
  // Lattice coordinates have 42 bits: 26 high and 16 low ones are exact in 32-bit arithmetic.
  const auto low16 = hn::Set(u, 0xffffU);
  const auto relative = [&](VU low, VU high10, double centre) {
    // A receiver far outside the frame keeps its distance in the float that is taken off last.
    const double whole = std::floor(std::clamp(centre, -0x1p46, 0x1p46));
    const auto integer = static_cast<std::int64_t>(whole);
    const auto upper = hn::Or(hn::ShiftRight<16>(low), hn::ShiftLeft<16>(high10));
    const auto dh = hn::Sub(hn::BitCast(i, upper), hn::Set(i, static_cast<std::int32_t>(integer >> 16)));
    const auto dl = hn::Sub(hn::BitCast(i, hn::And(low, low16)), hn::Set(i, static_cast<std::int32_t>(integer & 0xffff)));
    const auto rest = hn::Sub(hn::ConvertTo(f, dl), hn::Set(f, static_cast<float>(centre - whole)));
    const auto units = hn::MulAdd(hn::ConvertTo(f, dh), hn::Set(f, 65536.0F), rest);
    return hn::Mul(units, hn::Set(f, static_cast<float>(test.unit)));
  };
  for (int from = 0; from < 8 && mask >> from != 0; from += lanes) {
    auto wanted = mask_of(mask >> from);
    const std::size_t k = first + static_cast<std::size_t>(from);
    const auto word = [&](std::size_t bytes_before) {
      return hn::LoadU(u, reinterpret_cast<const std::uint32_t*>(payload + bytes_before * n + 4 * k));
    };
    const auto high = word(12);
    const auto ten = hn::Set(u, 1023U);
    const Vec to{relative(word(0), hn::And(high, ten), cell.centre.x),
                 relative(word(4), hn::And(hn::ShiftRight<10>(high), ten), cell.centre.y),
                 relative(word(8), hn::And(hn::ShiftRight<20>(high), ten), cell.centre.z)};
    const auto r = hn::BitCast(f, word(16));
    const auto coordinate = [&](std::size_t bytes_before) {
      const auto bits = hn::LoadU(I16(), reinterpret_cast<const std::int16_t*>(payload + bytes_before * n + 2 * k));
      return hn::Max(hn::Mul(hn::ConvertTo(f, hn::PromoteTo(i, bits)), hn::Set(f, 1.0F / 32767)), hn::Set(f, -1.0F));
    };
    const Vec normal = unfold(coordinate(20), coordinate(22));
    const auto d2 = dot(to, to);
    wanted = hn::And(wanted, hn::Gt(r, hn::Zero(f)));
    if (cell.has_horizon) {
      const auto rise = hn::Min(greatest_rise(cell, dot(normal, axis), hn::Zero(f), r), r);
      wanted = hn::And(wanted, hn::Gt(hn::Add(highest(cell, d2, dot(to, axis)), rise), hn::Zero(f)));
    }
    if (test.sides == Sides::front) wanted = hn::And(wanted, hn::Lt(dot(to, normal), hn::Set(f, cell.radius)));
    if (hn::AllFalse(f, wanted)) continue;
    const auto d = hn::Sqrt(d2);
    if (!test.last) {
      const auto above = hn::Add(dot(to, axis), hn::Add(r, hn::Set(f, cell.radius)));
      keep |= bits_of(f, hn::And(wanted, hn::Lt(d, seam_end(test, hn::Abs(dot(to, normal)), above, d)))) << from;
    }
    const auto drawn = hn::And(wanted, hn::Ge(d, hn::Set(f, test.shared_from)));
    if (hn::AllFalse(f, drawn)) continue;
    const auto half = [&](std::size_t bytes_before) {
      return hn::PromoteTo(f, hn::LoadU(F16(), reinterpret_cast<const hwy::float16_t*>(payload + bytes_before * n + 2 * k)));
    };
    push(queue, drawn, to, normal, r, pack_rgbe(half(24), half(26), half(28)));
  }
  return keep;
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(gather_group);
HWY_EXPORT(gather_surfels);

GroupVerdict gather_group(const GroupView& group, unsigned mask, const CellTest& test, DiscQueue& queue) {
  return HWY_DYNAMIC_DISPATCH(gather_group)(group, mask, test, queue);
}

unsigned gather_surfels(const std::byte* payload, std::uint32_t count, std::uint32_t first, unsigned mask,
                        const CellTest& test, DiscQueue& queue) {
  return HWY_DYNAMIC_DISPATCH(gather_surfels)(payload, count, first, mask, test, queue);
}

}  // namespace ptc
#endif
