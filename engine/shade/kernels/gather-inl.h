// The mathematics that gathering clusters and gathering surfels share; every function works on all
// lanes of a vector. The file is included by files that are compiled once for each instruction set,
// so it is guarded once for each instruction set.
//
// The horizon. A thing is dropped when it lies below the horizons of all receivers of a cell. Their
// normals n lie in a cone of half angle phi about the axis a, and a thing at the vector p, at the
// angle theta to a, rises over the horizon of n by p . n. The greatest rise is that of the normal
// that leans most towards p:
//
//            a    n                            theta > phi:  |p| cos(theta - phi)
//            ^   ^         p                     = cos phi (p . a) + sin phi |p - (p . a) a|
//            |phi/      .
//            |  /    .                         theta <= phi: |p|, because some normal points at p
//            | /  .  theta, from a to p
//            |/.
//     -------x------------- horizon of a
//
// highest() adds how far receivers lie below the centre, and max_rise() what the extent of the
// thing adds: a slab of half thickness `thick` and radius `wide` reaches thick + wide sin(angle
// between n and the slab's normal) along n, and the greatest such sine over the cone follows from
// the same addition theorem. Source: spec/shading.md#horizon.
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

/// Width of a seam over rho / h, the cell's radius over its height above the plane of the thing.
constexpr float kSeam = 0.5F;

/// Loads 16-bit numbers, as nodes store them.
HWY_INLINE VU load_u16(const std::byte* at) {
  return hn::PromoteTo(U(), hn::LoadU(U16(), reinterpret_cast<const std::uint16_t*>(at)));
}
/// Converts whole numbers below 2^31 to floats.
HWY_INLINE VF to_float(VU v) {
  return hn::ConvertTo(F(), hn::BitCast(I(), v));
}
/// Loads unsigned 16-bit floats: the exponent and the upper 8 bits of the mantissa of a float
/// (format/scalar.h).
HWY_INLINE VF load_ufloat16(const std::byte* at) {
  return hn::BitCast(F(), hn::ShiftLeft<15>(load_u16(at)));
}

/// A vector of three dimensions in each lane.
struct Vec {
  VF x, y, z;
};
HWY_INLINE VF dot(const Vec& a, const Vec& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
/// Returns the same vector in each lane.
HWY_INLINE Vec spread(const glm::vec3& v) {
  return {hn::Set(F(), v.x), hn::Set(F(), v.y), hn::Set(F(), v.z)};
}
HWY_INLINE Vec scaled(const Vec& v, VF by) {
  return {hn::Mul(v.x, by), hn::Mul(v.y, by), hn::Mul(v.z, by)};
}

/// Unfolds a point of the square [-q, q]^2 into a unit vector: the octahedral map, whose scalar
/// twin is in format/scalar.h. The coordinates are whole numbers, so the fold is exact.
///
///     +-----+-----+       The inner diamond |u| + |v| <= q is the upper half of the octahedron
///     | L / | \ L |       seen from above; the four corner triangles L are the faces of the lower
///     | /   |   \ |       half, folded outwards. The point on the octahedron is normalised.
///     +-----+-----+ u
///     | \   |   / |
///     | L \ | / L |
///     +-----+-----+
/// @param u, v  whole numbers, -q to q
HWY_INLINE Vec unfold(VF u, VF v, float q) {
  const F f;
  const auto edge = hn::Set(f, q);
  const auto z = hn::Sub(edge, hn::Add(hn::Abs(u), hn::Abs(v)));
  const auto lower = hn::Lt(z, hn::Zero(f));
  const auto x = hn::IfThenElse(lower, hn::CopySign(hn::Sub(edge, hn::Abs(v)), u), u);
  const auto y = hn::IfThenElse(lower, hn::CopySign(hn::Sub(edge, hn::Abs(u)), v), v);
  const Vec n{x, y, z};
  return scaled(n, hn::Div(hn::Set(f, 1.0F), hn::Sqrt(dot(n, n))));
}

/// Returns coordinates of a page relative to a centre.
///
///     41                   16 15             0     The centre's half is subtracted from each half
///     [ upper 26 bits        | lower 16 bits ]     in 32-bit integers, and the differences become
///                                                  floats.
///
/// So the result is rounded relative to its own size, not to the size of the scene. A centre far
/// outside the frame is clamped to 2^46 units, and what is beyond is subtracted as a float.
/// @param low     lower 32 bits of the coordinates
/// @param high10  upper 10 bits of the coordinates
/// @param centre  lattice units
HWY_INLINE VF relative(VU low, VU high10, double centre) {
  const F f;
  const I i;
  const U u;
  const double whole = std::floor(std::clamp(centre, -0x1p46, 0x1p46));
  const auto integer = static_cast<std::int64_t>(whole);
  const auto upper = hn::Or(hn::ShiftRight<16>(low), hn::ShiftLeft<16>(high10));
  const auto lower = hn::And(low, hn::Set(u, 0xffffU));
  const auto dh =
      hn::Sub(hn::BitCast(i, upper), hn::Set(i, static_cast<std::int32_t>(integer >> 16)));
  const auto dl =
      hn::Sub(hn::BitCast(i, lower), hn::Set(i, static_cast<std::int32_t>(integer & 0xffff)));
  const auto rest = hn::Sub(hn::ConvertTo(f, dl), hn::Set(f, static_cast<float>(centre - whole)));
  const auto units = hn::MulAdd(hn::ConvertTo(f, dh), hn::Set(f, 65536.0F), rest);
  return hn::Mul(units, hn::Set(f, static_cast<float>(SceneScale::kLatticeUnit)));
}

/// A vector of surfels relative to a centre, in edges of the frame.
struct PageSurfels {
  Vec to, normal;
  VF radius;
};

/// Loads surfels of a point page (spec/points.md#point-page): a vector of them from number `first`
/// on.
/// @param payload  of the page; up to 64 bytes past its end may be read
/// @param count    number of points on the page
/// @param centre   lattice units
/// @param lengths  convert lengths from scene units to edges
HWY_INLINE PageSurfels load_surfels(const std::byte* payload, std::size_t count, std::size_t first,
                                    const glm::dvec3& centre, const SceneScale::Factors& lengths) {
  // Find the columns: one that `bytes_before` bytes of each point precede begins at that times n.
  const F f;
  const I i;
  const U u;
  const auto word = [&](std::size_t bytes_before) {
    return hn::LoadU(
        u, reinterpret_cast<const std::uint32_t*>(payload + bytes_before * count + 4 * first));
  };
  const auto high = word(12);
  const auto ten = hn::Set(u, 1023U);
  const auto coordinate = [&](std::size_t bytes_before) {
    const auto bits = hn::LoadU(
        I16(), reinterpret_cast<const std::int16_t*>(payload + bytes_before * count + 2 * first));
    return hn::Max(hn::ConvertTo(f, hn::PromoteTo(i, bits)), hn::Set(f, -32767.0F));
  };
  return {.to = {relative(word(0), hn::And(high, ten), centre.x),
                 relative(word(4), hn::And(hn::ShiftRight<10>(high), ten), centre.y),
                 relative(word(8), hn::And(hn::ShiftRight<20>(high), ten), centre.z)},
          .normal = unfold(coordinate(20), coordinate(22), 32767),
          .radius = hn::Min(hn::Mul(hn::Mul(hn::BitCast(f, word(16)), hn::Set(f, lengths[0])),
                                    hn::Set(f, lengths[1])),
                            hn::Set(f, SceneScale::kMaxRadius))};
}

/// Packs colours as encode_rgbe() does, except that a component that rounds up to 256 stays 255.
HWY_INLINE VU pack_rgbe(VF r, VF g, VF b) {
  const F f;
  const I i;
  const U u;
  const auto greatest = hn::Max(r, hn::Max(g, b));
  // Find the least e with 2^e > greatest: the exponent field of that float is e + 126.
  const auto field = hn::ShiftRight<23>(hn::BitCast(u, greatest));
  const auto exponent = hn::BitCast(i, hn::Add(field, hn::Set(u, 2U)));  // e + 128
  const auto scale =
      hn::BitCast(f, hn::ShiftLeft<23>(hn::Sub(hn::Set(i, 263), exponent)));  // 2^(8 - e)
  // Round each component to a byte.
  const auto byte = [&](VF c) {
    return hn::BitCast(
        u, hn::ConvertTo(i, hn::Min(hn::MulAdd(c, scale, hn::Set(f, 0.5F)), hn::Set(f, 255.0F))));
  };
  const auto packed =
      hn::Or(hn::Or(byte(r), hn::ShiftLeft<8>(byte(g))),
             hn::Or(hn::ShiftLeft<16>(byte(b)), hn::ShiftLeft<24>(hn::BitCast(u, exponent))));
  // Take black below 2^-100: nothing there is bright enough to see, and the scale would overflow.
  return hn::IfThenElseZero(hn::RebindMask(u, hn::Gt(greatest, hn::Set(f, 0x1p-100F))), packed);
}

/// Adds colours.
HWY_INLINE VU sum_rgbe(VU a, VU b) {
  const F f;
  const UnpackedRgbe<F> x = unpack_rgbe(f, a), y = unpack_rgbe(f, b);
  const auto sum = [&](int k) {
    return hn::MulAdd(x.byte[k], x.scale, hn::Mul(y.byte[k], y.scale));
  };
  return pack_rgbe(sum(0), sum(1), sum(2));
}

/// Returns the mask of bits, the first lane in bit 0.
HWY_INLINE MF mask_of(unsigned bits) {
  const U u;
  alignas(64) static constexpr std::uint32_t kBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
  return hn::RebindMask(F(), hn::TestBit(hn::Set(u, bits), hn::LoadU(u, kBit)));
}

/// Appends the discs in the lanes of a mask to a queue.
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

/// Returns how high the middle of a thing may rise over the horizon of any receiver of the cell, a
/// length: the greatest p . n over the normals of the cone, plus how far receivers lie below the
/// centre, plus what rounding may take from both.
/// @param distance2  |p|^2, p the thing's middle relative to the centre
/// @param along      p . axis
HWY_INLINE VF highest(const ReceiverCell& cell, VF distance2, VF along) {
  const F f;
  const auto across = hn::Sqrt(hn::Max(hn::NegMulAdd(along, along, distance2), hn::Zero(f)));
  const auto turned =
      hn::MulAdd(hn::Set(f, cell.cone_cos), along, hn::Mul(hn::Set(f, cell.cone_sin), across));
  // Inside the cone the greatest p . n is the distance itself.
  const auto inside =
      hn::Gt(hn::Mul(hn::Set(f, cell.cone_sin), along), hn::Mul(hn::Set(f, cell.cone_cos), across));
  const auto distance = hn::Sqrt(distance2);
  const auto below =
      hn::MulAdd(distance, hn::Set(f, kRounding), hn::Set(f, cell.depth * (1 + kRounding)));
  return hn::Add(hn::IfThenElse(inside, distance, turned), below);
}

/// Returns the greatest half extent of a slab along any normal of the cone. The slab reaches
/// `thick` along its own normal and `wide` across it, on both sides of its middle.
/// @param cosine  of the angle between the slab's normal and the cone's axis
HWY_INLINE VF max_rise(const ReceiverCell& cell, VF cosine, VF thick, VF wide) {
  const F f;
  const auto sine = hn::Sqrt(hn::Max(hn::NegMulAdd(cosine, cosine, hn::Set(f, 1.0F)), hn::Zero(f)));
  const auto cone_cos = hn::Set(f, cell.cone_cos), cone_sin = hn::Set(f, cell.cone_sin);
  auto tilt = hn::MulAdd(sine, cone_cos, hn::Mul(hn::Abs(cosine), cone_sin));
  const auto edge_on =
      hn::Lt(hn::Mul(hn::Abs(cosine), cone_cos), hn::Mul(sine, cone_sin));  // square to some normal
  tilt = hn::IfThenElse(edge_on, hn::Set(f, 1.0F), tilt);
  return hn::MulAdd(wide, tilt, thick);
}

/// Returns the distance up to which the children of a cell draw a thing that the cell draws, too:
/// (1 + s) times shared_from.
///
///     x centre             rho / k     (1 + s) rho / k
///     |                       |              |
///     +-----------------------+--------------+--------------- surface
///     |children draw ----------------------->|
///                             |the cell draws, as its centre sees it ----->
///
/// A receiver that is farther from the surface than the centre would see a gap between the two
/// parts, were s 0. s = min(1, rho / 2 h) min(1, sine of the elevation of the thing's top), because
/// light weighs little at the horizon. Source: spec/shading.md#seams.
/// @param height  h, of the cell's centre over the plane of the thing, not negative
/// @param above   how far the thing's top stands over the horizon of the centre
/// @param d       distance of the thing from the centre
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
