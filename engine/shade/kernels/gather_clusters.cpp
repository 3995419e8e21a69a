// Decides what becomes of clusters, and turns those that are drawn into discs.
//
// A cluster is a bounding sphere (radius r), a slab across its mean normal (thickness), an area A,
// and an ambient cube: for each of the 6 axes, the share f of the area that faces it, and the mean
// radiance L of that share. The mean normal S, the sum of area times normal over A, is the
// difference of opposite shares. Towards a receiver, in the unit direction w, three faces of the
// cube look:
//
//            +---+y---+  / w      front = sum of |w_k| f_k over the three faces that look at w
//            |        | /         back  = front - S . w
//           -x    x   +x          projected area = A max(front, back)
//            |        |           (A front when backs are clear)
//            +---y----+
//
// A flat cluster, |S| > 0.9, is drawn as one surfel. A sheet, thinner than a fifth of r, is drawn
// as the nearer of its two sides, for which S or -S takes the place of w above: a wall of surfels
// back to back, lit on one side, has both bright and dark faces towards most w. Any other is an
// ellipsoid of revolution about S, of the ratio s between its axes. Its silhouette is that of a
// disc:
//
//                  S                  c = cosine between S and w
//              ____|____     / w      q = sqrt(c^2 + s^2 (1 - c^2)), its foreshortening
//          . '     |     ' .          the disc's normal lies in the plane of S and w, at the
//         (        x        )         cosine q to w
//          ' . ___ s ___ . '          radius^2 = inflation A max(front, back) / (pi q),
//                                     at most 0.55 r^2
//
// The radiance is that of the fronts, sum of |w_k| f_k L_k, spread over the disc: dimmed where
// backs outweigh fronts twice. spec/shading.md#splats has the rules and what they gain; the plain
// gather (engine/shade/reference/plain_gather.cpp) has the same rules without vectors. The cut
// through the octree is that of Kontkanen, Tabellion and Overbeck 2011, shared by the receivers of
// a cell.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "engine/base/numbers.h"
#include "engine/shade/kernels/gather_kernels.h"
#include "engine/shade/outgoing.h"

// This file is compiled once per instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/kernels/gather_clusters.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/shade/kernels/gather-inl.h"
#include "format/node_layout.h"
#include "format/scalar.h"

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {
namespace {

constexpr float kMaxStoredArea = 0x1.ffp127F;  // the greatest finite ufloat16
constexpr float kPerFacingStep = 1.0F / static_cast<float>(kFacingSteps);

/// A vector of clusters relative to a cell's centre, in edges of the frame.
struct Clusters {
  Vec to;                ///< mean position
  VF radius, thickness;  ///< of the bounding sphere, and of the slab
  Vec mean;              ///< S: sum of area times normal over the area, not unit
  VF length;             ///< |S|: 1 where all surfels face one way
  Vec normal;            ///< unit, along S; NaN where S is zero
  VF distance2;          ///< |to|^2
};

/// Computes the members that follow from the others.
HWY_INLINE void set_derived(Clusters& c) {
  c.length = hn::Sqrt(dot(c.mean, c.mean));
  c.normal = scaled(c.mean, hn::Div(hn::Set(F(), 1.0F), c.length));
  c.distance2 = dot(c.to, c.to);
}

/// Returns how far clusters may reach over the horizon of some receiver; what is not above 0 is
/// under the horizon of all.
HWY_INLINE VF top(const CellTest& test, const Clusters& c) {
  const Vec axis = spread(test.cell.axis);
  // Take the lesser of sphere and slab. A mean normal of zero gives NaN, and so the sphere.
  auto rise = max_rise(test.cell, dot(c.normal, axis), c.thickness, c.radius);
  rise = hn::IfThenElse(hn::Lt(rise, c.radius), rise, c.radius);
  return hn::Add(highest(test.cell, c.distance2, dot(c.to, axis)), rise);
}

HWY_INLINE MF over_horizon(const CellTest& test, const Clusters& c) {
  return hn::Gt(top(test, c), hn::Zero(F()));
}

/// The decision about each cluster of a vector.
struct Verdict {
  MF drawn, open, keep;
  MF stand_in;  ///< drawn clusters that are not small enough, but closed
};

/// Decides about clusters that reach over the horizon (gather_kernels.h has the table).
/// @param d       distances
/// @param wanted  clusters to decide about
/// @param closed  clusters that are not to be opened, however large they are
HWY_INLINE Verdict judge(const CellTest& test, const Clusters& c, VF d, MF wanted, MF closed) {
  // Find those that are small, as seen from the nearest place of the cell; closed ones count as
  // small.
  const F f;
  const auto limit = hn::Set(f, test.limit), rho = hn::Set(f, test.cell.radius),
             shared_from = hn::Set(f, test.shared_from);
  const auto nearest = hn::Max(hn::Zero(f), hn::Sub(d, rho));
  const auto r2 = hn::Mul(c.radius, c.radius);
  const auto fine = hn::Lt(r2, hn::Mul(limit, hn::Mul(nearest, nearest)));  // for every receiver
  const auto small = hn::And(wanted, hn::Or(fine, closed));
  const auto large = hn::AndNot(small, wanted);
  // Draw small ones that are far enough to share.
  const auto drawn = hn::And(small, hn::Ge(d, shared_from));
  const auto stand_in = hn::AndNot(fine, drawn);
  if (test.last) return {drawn, large, hn::FirstN(f, 0), stand_in};
  // Open large ones that every receiver would open, or whose parts are all far enough to share.
  const auto farthest = hn::Add(d, rho);
  const auto opens = hn::And(hn::Or(hn::Ge(hn::Sub(d, c.radius), shared_from),
                                    hn::Ge(r2, hn::Mul(limit, hn::Mul(farthest, farthest)))),
                             hn::Ge(hn::Add(d, c.radius), hn::Set(f, test.kept_within)));
  // Keep small ones in the seam. Some part of a cluster that faces many ways is seen from the front
  // everywhere, so the height over its plane counts as d (1 - |S|) at least.
  const auto scattered = hn::Mul(d, hn::Max(hn::Sub(hn::Set(f, 1.0F), c.length), hn::Zero(f)));
  const auto height = hn::Max(hn::Abs(dot(c.to, c.mean)), scattered);
  const auto above = hn::Add(dot(c.to, spread(test.cell.axis)), hn::Add(c.radius, rho));
  const auto band = hn::Lt(d, seam_end(test, height, above, d));
  return {drawn, hn::And(large, opens), hn::Or(hn::AndNot(opens, large), hn::And(small, band)),
          stand_in};
}

/// Counts clusters that are drawn in place of their children, and bounds the cosine-weighted share
/// of a receiver's hemisphere that they may cover: that of the cluster's sphere, or that of a wedge
/// as wide as the sphere and as high as the cluster reaches over the horizon, whichever is less.
/// Source: spec/shading.md#damage.
HWY_INLINE void count_stand_ins(const CellTest& test, MF mask, const Clusters& c, VF d,
                                CellOutput& out) {
  const F f;
  if (hn::AllFalse(f, mask)) return;
  const auto one = hn::Set(f, 1.0F);
  const auto nearest = hn::Max(hn::Zero(f), hn::Sub(d, hn::Set(f, test.cell.radius)));
  const auto wide = hn::Div(c.radius, nearest);
  auto share = hn::Mul(wide, wide);
  if (test.cell.has_horizon) {
    const auto high = hn::Min(hn::Div(top(test, c), hn::Sub(nearest, c.radius)), one);
    share = hn::Min(share, hn::Mul(hn::Mul(hn::Set(f, 0.5F), wide), hn::Mul(high, high)));
  }
  share = hn::IfThenElse(hn::Lt(c.radius, nearest), share, one);
  out.stand_ins += static_cast<unsigned>(hn::CountTrue(f, mask));
  out.stand_in_share += hn::GetLane(hn::SumOfLanes(f, hn::IfThenElseZero(mask, share)));
}

/// Returns the clusters all of whose surfels show their backs to every receiver.
///
/// All normals lie in a cone of half angle gamma about the cluster's axis, and all ways from a
/// receiver to a surfel in a sphere of radius r + rho around the way p between the centres. So
/// every surfel shows its back where
///
///     angle(axis, p) + gamma + asin((r + rho) / |p|) < 90 degrees
///     axis . p > sin gamma sqrt(|p|^2 - (r + rho)^2) + cos gamma (r + rho),
///
/// and taking 1 for cos gamma is on the safe side.
HWY_INLINE MF faces_away(const GroupView& group, int first, const CellTest& test, const Vec& to,
                         VF distance2, VF radius) {
  // Decode the cone.
  const F f;
  const I i;
  const auto cosine = hn::Mul(
      hn::ConvertTo(f, hn::PromoteTo(i, hn::LoadU(I16(), reinterpret_cast<const std::int16_t*>(
                                                             group.cone_cos() + 2 * first)))),
      hn::Set(f, 1.0F / static_cast<float>(kCosSteps)));
  const auto packed = hn::BitCast(i, load_u16(group.cone_axis() + 2 * first));
  const auto coordinate = [&](auto bits) {
    return hn::Max(hn::ConvertTo(f, hn::ShiftRight<24>(bits)), hn::Set(f, -127.0F));
  };
  const Vec axis =
      unfold(coordinate(hn::ShiftLeft<24>(packed)), coordinate(hn::ShiftLeft<16>(packed)), 127);
  // Compare the angles.
  const auto reach = hn::Add(radius, hn::Set(f, test.cell.radius));
  const auto clear = hn::NegMulAdd(reach, reach, distance2);
  auto sine = hn::Sqrt(hn::Max(hn::NegMulAdd(cosine, cosine, hn::Set(f, 1.0F)), hn::Zero(f)));
  sine = hn::Add(sine, hn::Set(f, 0.02F));  // allows for the rounding of the axis
  const auto least = hn::MulAdd(sine, hn::Sqrt(hn::Max(clear, hn::Zero(f))), reach);
  return hn::And(hn::And(hn::Gt(cosine, hn::Set(f, 0.05F)), hn::Gt(clear, hn::Zero(f))),
                 hn::Gt(dot(axis, to), least));
}

/// Returns the radiance of clusters as RGBE: that of the fronts over what they are spread over.
/// Backs dim a cluster that is not flat, but only half of them count, since most are hidden; a flat
/// disc has a black back.
/// @param cube        as of draw_clusters()
/// @param along_axis  direction from the cluster to the receiver
/// @param weight      share of the area that looks at the receiver, of each of three faces
/// @param front       sum of `weight`
/// @param projected   projected area over the area
template <class Cube>
HWY_INLINE VU colour_of(const Cube& cube, const VF (&along_axis)[3], const VF (&weight)[3],
                        VF front, MF flat, VF projected) {
  const F f;
  const auto zero = hn::Zero(f), one = hn::Set(f, 1.0F);
  const auto over =
      hn::IfThenElse(flat, front, hn::Max(front, hn::Mul(hn::Set(f, kDark), projected)));
  const auto mix = hn::IfThenElse(hn::Gt(over, zero), hn::Div(one, over), zero);
  VF light[3] = {zero, zero, zero};
  for (int k = 0; k < 3; ++k) {
    const UnpackedRgbe<F> radiance = unpack_rgbe(f, cube.radiance(k, hn::Lt(along_axis[k], zero)));
    const auto scale = hn::Mul(radiance.scale, hn::Mul(weight[k], mix));
    for (int channel = 0; channel < 3; ++channel)
      light[channel] = hn::MulAdd(radiance.byte[channel], scale, light[channel]);
  }
  return pack_rgbe(light[0], light[1], light[2]);
}

/// Appends clusters as discs (spec/shading.md#splats).
/// @param mask      clusters to draw
/// @param distance  of each cluster
/// @param area      of each cluster, scene units squared
/// @param cube      gives share(axis, negative), the share of the area that faces an axis, and
///                  radiance(axis, negative), its RGBE; lanes of `negative` mean the opposite axis
template <class Cube>
HWY_INLINE void draw_clusters(const CellTest& test, MF mask, const Clusters& c, VF distance,
                              VF area, const Cube& cube, DiscQueue& queue) {
  // Convert the area. One that did not fit its field is only known to be large, and counts as
  // infinite: the sphere limits the disc.
  const F f;
  const auto zero = hn::Zero(f), one = hn::Set(f, 1.0F);
  const auto known = hn::Lt(area, hn::Set(f, kMaxStoredArea));
  area = hn::Mul(hn::Mul(area, hn::Set(f, test.areas[0])), hn::Set(f, test.areas[1]));
  area = hn::IfThenElse(known, area, hn::Inf(f));
  // Find the mean normal, and whether the cluster is a sheet, whose near side looks along it or
  // against it.
  const auto flat = hn::Gt(c.length, hn::Set(f, kFlat)),
             directed = hn::Gt(c.length, hn::Set(f, kDirected));
  const auto sheet = hn::And(
      directed, hn::AndNot(flat, hn::Lt(c.thickness, hn::Mul(hn::Set(f, kSheet), c.radius))));
  const Vec normal{hn::IfThenElseZero(directed, c.normal.x),
                   hn::IfThenElseZero(directed, c.normal.y),
                   hn::IfThenElseZero(directed, c.normal.z)};
  const Vec toward = scaled(c.to, hn::Div(hn::Set(f, -1.0F), distance));
  const auto cosine = dot(normal, toward);
  const auto side = hn::CopySign(one, cosine);
  const auto look = [&](VF along_normal, VF along) {
    return hn::IfThenElse(sheet, hn::Mul(side, along_normal), along);
  };
  const Vec from{look(normal.x, toward.x), look(normal.y, toward.y), look(normal.z, toward.z)};
  const VF along_axis[3] = {from.x, from.y, from.z};
  // Sum up the three faces that look there, and find the projected area. Fronts less backs are the
  // mean normal's projection.
  VF weight[3], front = zero;
  for (int k = 0; k < 3; ++k) {
    weight[k] = hn::Mul(hn::Abs(along_axis[k]), cube.share(k, hn::Lt(along_axis[k], zero)));
    front = hn::Add(front, weight[k]);
  }
  const auto projected =
      test.sides == Sides::both ? hn::Max(front, hn::Sub(front, dot(c.mean, from))) : front;
  mask = hn::And(mask, hn::Gt(hn::Mul(area, projected), zero));

  // Find the normal of the disc: the cluster's own where it is flat, that of its near side where it
  // is a sheet, else that of the disc with the ellipsoid's silhouette, turn * normal + rest *
  // toward.
  const auto ratio = hn::Mul(hn::Set(f, kSlim), hn::Div(c.thickness, c.radius));
  const auto slim = hn::IfThenElse(hn::And(directed, hn::Lt(ratio, one)), ratio, one);
  const auto lean2 = hn::NegMulAdd(slim, slim, one);
  const auto foreshortened =
      hn::Sqrt(hn::MulAdd(lean2, hn::Mul(cosine, cosine), hn::Mul(slim, slim)));
  const auto plane = hn::Or(flat, sheet);
  const auto turn =
      hn::IfThenElse(flat, one, hn::Mul(side, hn::IfThenElse(sheet, one, hn::Sqrt(lean2))));
  const auto rest = hn::IfThenElse(plane, zero, hn::NegMulAdd(turn, cosine, foreshortened));
  const Vec disc_normal{hn::MulAdd(turn, normal.x, hn::Mul(rest, toward.x)),
                        hn::MulAdd(turn, normal.y, hn::Mul(rest, toward.y)),
                        hn::MulAdd(turn, normal.z, hn::Mul(rest, toward.z))};
  // Find its radius: from half the area where it is flat or a sheet, else from the projected area.
  const auto seen =
      hn::Mul(hn::Set(f, test.inflation / kPi), hn::Div(hn::Mul(area, projected), foreshortened));
  const auto half = hn::Mul(hn::Mul(area, hn::Set(f, 0.5F)), hn::IfThenElse(flat, one, projected));
  const auto wanted = hn::IfThenElse(plane, half, seen);
  const auto most =
      hn::Mul(hn::IfThenElse(plane, one, hn::Set(f, kSolid)), hn::Mul(c.radius, c.radius));
  const auto radius2 = hn::IfThenElse(hn::Lt(wanted, most), wanted, most);

  const VU colour =
      test.bleeding ? colour_of(cube, along_axis, weight, front, flat, projected) : hn::Zero(U());
  push(queue, mask, c.to, disc_normal, hn::Sqrt(radius2), colour);
}

/// Appends clusters to those left to the children. Positions are rounded relative to their
/// distance, so radius and thickness grow by that rounding.
/// @param payload  index of each cluster's payload
HWY_INLINE void leave(NearClusters& left, MF mask, const Clusters& c, VF distance, VU payload) {
  const F f;
  const U u;
  const std::size_t at = left.size;
  const auto rounding = hn::Mul(distance, hn::Set(f, kRounding));
  append(c.to.x, mask, f, left.x.data() + at);
  append(c.to.y, mask, f, left.y.data() + at);
  append(c.to.z, mask, f, left.z.data() + at);
  append(hn::Add(c.radius, rounding), mask, f, left.radius.data() + at);
  append(hn::Add(c.thickness, rounding), mask, f, left.thickness.data() + at);
  append(c.mean.x, mask, f, left.mean_x.data() + at);
  append(c.mean.y, mask, f, left.mean_y.data() + at);
  append(c.mean.z, mask, f, left.mean_z.data() + at);
  left.size += append(payload, hn::RebindMask(u, mask), u, left.payload.data() + at);
}

/// The children of a group, read from the columns of its page.
class GroupLanes {
 public:
  /// Finds the step of position codes: the edge of the group's cell over 2^16.
  GroupLanes(const GroupView& group, const CellTest& test)
      : group_(group), corner_(decode_morton(group.cell())), test_(test) {
    step_ = static_cast<float>(cell_edge(group.level()) * SceneScale::kLatticeUnit / kMeanSteps);
  }

  /// Loads a vector of children, from number `first` on.
  HWY_INLINE Clusters load(int first) {
    const F f;
    const int at = 2 * first;
    const auto step = hn::Set(f, step_),
               unit = hn::Set(f, static_cast<float>(SceneScale::kLatticeUnit));
    // Bound the radius by what encloses discs that are as large as they may be.
    const auto most = hn::Set(f, 2 * SceneScale::kMaxRadius);
    const auto offset = [&](std::size_t k, double centre) {
      return hn::Set(f, static_cast<float>((static_cast<double>(corner_[k]) - centre) *
                                           SceneScale::kLatticeUnit));
    };
    const glm::dvec3& centre = test_.cell.centre;
    for (int k = 0; k < 6; ++k) {
      share_[k] = hn::Mul(to_float(load_u16(group_.facing(k) + at)), hn::Set(f, kPerFacingStep));
    }
    Clusters c{
        .to = {hn::MulAdd(step, to_float(load_u16(group_.mean_x() + at)), offset(0, centre.x)),
               hn::MulAdd(step, to_float(load_u16(group_.mean_y() + at)), offset(1, centre.y)),
               hn::MulAdd(step, to_float(load_u16(group_.mean_z() + at)), offset(2, centre.z))},
        .radius = hn::Min(hn::Mul(unit, load_ufloat16(group_.radius() + at)), most),
        .thickness = hn::Min(hn::Mul(unit, load_ufloat16(group_.thickness() + at)), most),
        .mean = {hn::Sub(share_[0], share_[1]), hn::Sub(share_[2], share_[3]),
                 hn::Sub(share_[4], share_[5])}};
    set_derived(c);
    return c;
  }

  /// Draws the children of a mask among those that load() returned last.
  HWY_INLINE void draw(int first, MF mask, const Clusters& c, VF distance, DiscQueue& queue) const {
    draw_clusters(test_, mask, c, distance, load_ufloat16(group_.area() + 2 * first),
                  Cube{*this, first}, queue);
  }

 private:
  /// The ambient cubes of a vector of children, as draw_clusters() takes them.
  struct Cube {
    const GroupLanes& lanes;
    int first;

    HWY_INLINE VF share(int axis, MF negative) const {
      return hn::IfThenElse(negative, lanes.share_[2 * axis + 1], lanes.share_[2 * axis]);
    }
    HWY_INLINE VU radiance(int axis, MF negative) const {
      const GroupView& group = lanes.group_;
      const VU reflected =
          of_face(group.radiance(2 * axis), group.radiance(2 * axis + 1), negative);
      if (!group.emits() || !lanes.test_.emission) return reflected;
      return sum_rgbe(reflected,
                      of_face(group.emission(2 * axis), group.emission(2 * axis + 1), negative));
    }

   private:
    /// Returns the colours of the children's faces towards an axis or its opposite.
    HWY_INLINE VU of_face(const std::byte* positive, const std::byte* opposite, MF negative) const {
      const U u;
      const auto load = [&](const std::byte* column) {
        return hn::LoadU(u, reinterpret_cast<const std::uint32_t*>(column + 4 * first));
      };
      return hn::IfThenElse(hn::RebindMask(u, negative), load(opposite), load(positive));
    }
  };

  const GroupView& group_;
  LatticePoint corner_;  ///< of the group's cell
  const CellTest& test_;
  float step_;   ///< edges of the frame for one step of a position code
  VF share_[6];  ///< shares of the area of the children that load() returned last
};

/// Payloads of clusters that a cell left, one in each lane, gathered by 4-byte words:
///
///     word   0 .. 5   6 .. 11   12     13, 14      15
///            rgbe     share     area   reference   kind
class PayloadLanes {
 public:
  /// Refers to payloads. @param index  of the payload of each lane
  PayloadLanes(const ClusterPayload* payloads, VU index)
      : base_(reinterpret_cast<const float*>(payloads)),
        word_(hn::ShiftLeft<4>(hn::BitCast(I(), index))) {}

  HWY_INLINE MF closed() const {
    const U u;
    const auto kind = hn::BitCast(u, hn::GatherIndex(F(), base_ + 15, word_));
    return hn::RebindMask(F(), hn::TestBit(kind, hn::Set(u, kClosed)));
  }
  HWY_INLINE VF area() const { return hn::GatherIndex(F(), base_ + 12, word_); }
  HWY_INLINE VF share(int axis, MF negative) const {
    return hn::GatherIndex(F(), base_ + 6 + 2 * axis, face(negative));
  }
  HWY_INLINE VU radiance(int axis, MF negative) const {
    return hn::BitCast(U(), hn::GatherIndex(F(), base_ + 2 * axis, face(negative)));
  }

 private:
  /// Returns the word of an axis relative to that of the positive axis.
  HWY_INLINE hn::VFromD<I> face(MF negative) const {
    const I i;
    return hn::Add(word_, hn::IfThenElseZero(hn::RebindMask(i, negative), hn::Set(i, 1)));
  }

  const float* base_;
  hn::VFromD<I> word_;
};

/// Returns the payload of a child of a group.
/// @param emission  whether its colours have what it emits
ClusterPayload payload_of(const GroupView& group, int i, bool closed, bool emission) {
  ClusterPayload payload;
  for (int k = 0; k < 6; ++k) {
    payload.rgbe[k] = outgoing_rgbe(group, k, i, emission);
    payload.share[k] = static_cast<float>(GroupView::u16_at(group.facing(k), i)) * kPerFacingStep;
  }
  payload.area = decode_ufloat16(GroupView::u16_at(group.area(), i));
  const std::uint64_t reference = group.reference(i);
  payload.reference[0] = static_cast<std::uint32_t>(reference);
  payload.reference[1] = static_cast<std::uint32_t>(reference >> 32);
  payload.kind = (group.interior_mask() >> i & kInterior) | (closed ? kClosed : 0);
  return payload;
}

}  // namespace

unsigned gather_group(const GroupView& group, unsigned closed, const CellTest& test,
                      CellOutput& out) {
  const F f;
  const U u;
  const auto lanes = static_cast<int>(hn::Lanes(f));
  GroupLanes loader(group, test);
  unsigned opened = 0;
  for (int first = 0; first < group.size(); first += lanes) {
    // Drop children that no receiver sees.
    auto wanted = hn::FirstN(f, static_cast<std::size_t>(group.size() - first));
    const Clusters c = loader.load(first);
    if (test.cell.has_horizon) wanted = hn::And(wanted, over_horizon(test, c));
    if (test.sides == Sides::front)
      wanted = hn::AndNot(faces_away(group, first, test, c.to, c.distance2, c.radius), wanted);
    if (hn::AllFalse(f, wanted)) continue;
    // Draw and open those that are settled.
    const auto d = hn::Sqrt(c.distance2);
    const MF shut = mask_of(closed >> first);
    const Verdict verdict = judge(test, c, d, wanted, shut);
    if (closed != 0) count_stand_ins(test, verdict.stand_in, c, d, out);
    if (!hn::AllFalse(f, verdict.drawn)) loader.draw(first, verdict.drawn, c, d, out.queue);
    opened |= bits_of(f, verdict.open) << first;
    // Leave the others, with new payloads.
    if (hn::AllFalse(f, verdict.keep)) continue;
    const auto next = static_cast<std::uint32_t>(out.payloads.size());
    unsigned rest = bits_of(f, verdict.keep);
    alignas(64) std::uint32_t index[kListLanes] = {};
    make_room_in(out.payloads, kListLanes);
    for (std::uint32_t count = 0; rest != 0; rest &= rest - 1) {
      const int lane = std::countr_zero(rest);
      index[lane] = next + count++;
      out.payloads.push_back(
          payload_of(group, first + lane, (closed >> (first + lane) & 1) != 0, test.emission));
    }
    out.left->clusters.make_room(kListLanes);
    leave(out.left->clusters, verdict.keep, c, d, hn::LoadU(u, index));
  }
  return opened;
}

std::size_t gather_clusters(const NearClusters& near, std::size_t from, const glm::vec3& move,
                            const CellTest& test, CellOutput& out,
                            std::vector<std::uint32_t>& opened) {
  const F f;
  const U u;
  const std::size_t lanes = hn::Lanes(f);
  const auto numbers = hn::Iota(u, 0U);  // of lanes; Iota() is slow
  const Vec moved = spread(move);
  for (; from < near.size && !out.queue.full(); from += lanes) {
    // Load clusters relative to this cell's centre, and drop those that no receiver sees.
    const auto load = [&](const std::vector<float>& column) {
      return hn::LoadU(f, column.data() + from);
    };
    Clusters c{.to = {hn::Add(load(near.x), moved.x), hn::Add(load(near.y), moved.y),
                      hn::Add(load(near.z), moved.z)},
               .radius = load(near.radius),
               .thickness = load(near.thickness),
               .mean = {load(near.mean_x), load(near.mean_y), load(near.mean_z)}};
    set_derived(c);
    auto wanted = hn::FirstN(f, near.size - from);
    if (test.cell.has_horizon) wanted = hn::And(wanted, over_horizon(test, c));
    if (hn::AllFalse(f, wanted)) continue;
    // Decide what becomes of the others.
    const auto d = hn::Sqrt(c.distance2);
    const auto payload = hn::LoadU(u, near.payload.data() + from);
    MF shut = hn::FirstN(f, 0);
    if (test.damaged) {
      shut = hn::And(wanted, PayloadLanes(out.payloads.data(),
                                          hn::IfThenElseZero(hn::RebindMask(u, wanted), payload))
                                 .closed());
    }
    const Verdict verdict = judge(test, c, d, wanted, shut);
    if (test.damaged) count_stand_ins(test, verdict.stand_in, c, d, out);
    // Draw, open and leave them.
    if (!hn::AllFalse(f, verdict.drawn)) {
      const PayloadLanes cube(out.payloads.data(),
                              hn::IfThenElseZero(hn::RebindMask(u, verdict.drawn), payload));
      draw_clusters(test, verdict.drawn, c, d, cube.area(), cube, out.queue);
    }
    if (!hn::AllFalse(f, verdict.open)) {
      opened.resize(opened.size() + lanes);
      const auto index = hn::Add(numbers, hn::Set(u, static_cast<std::uint32_t>(from)));
      const std::size_t count =
          append(index, hn::RebindMask(u, verdict.open), u, opened.data() + opened.size() - lanes);
      opened.resize(opened.size() - lanes + count);
    }
    if (hn::AllFalse(f, verdict.keep)) continue;
    out.left->clusters.make_room(kListLanes);
    leave(out.left->clusters, verdict.keep, c, d, payload);
  }
  return std::min(from, near.size);
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(gather_group);
HWY_EXPORT(gather_clusters);

unsigned gather_group(const GroupView& group, unsigned closed, const CellTest& test,
                      CellOutput& out) {
  return HWY_DYNAMIC_DISPATCH(gather_group)(group, closed, test, out);
}

std::size_t gather_clusters(const NearClusters& near, std::size_t from, const glm::vec3& move,
                            const CellTest& test, CellOutput& out,
                            std::vector<std::uint32_t>& opened) {
  return HWY_DYNAMIC_DISPATCH(gather_clusters)(near, from, move, test, out, opened);
}

}  // namespace ptc
#endif
