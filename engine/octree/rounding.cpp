// Rounds points piece by piece in parallel. The position of a point may depend on the point before
// it, so each piece is first rounded as if it were the first, and its beginning is then rounded
// again with the true point before, until a position comes out the same.
#include "engine/octree/rounding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <vector>

#include <fmt/format.h>

namespace ptc {
namespace {

/// Rounds a radius to some bits behind the leading one.
float rounded_radius(float radius, int bits) noexcept {
  const std::uint32_t step = 1U << (23 - bits);
  const std::uint32_t pattern =
      (std::bit_cast<std::uint32_t>(radius + 0.0F) + step / 2) & ~(step - 1);
  return std::bit_cast<float>(std::min(pattern, 0x7f800000U - step));  // the greatest finite value
}

/// Rounds a component of a normal to a multiple of a power of two. The ends of the range, 32767 and
/// -32767, stay, because the axes lie on them.
std::int16_t rounded_normal(std::int16_t component, int bits) noexcept {
  const int step = 1 << (15 - bits);
  const int size = std::min((std::abs(int{component}) + step / 2) / step * step, 32767);
  return static_cast<std::int16_t>(component < 0 ? -size : size);
}

/// Rounds a half to some bits behind the leading one.
std::uint16_t rounded_radiance(std::uint16_t half, int bits) noexcept {
  if (half == 0x8000) return 0;  // -0
  const int step = 1 << (10 - bits);
  return static_cast<std::uint16_t>(std::min((half + step / 2) & ~(step - 1), 0x7c00 - step));
}

/// The stream that round_points() returns.
class RoundedStream : public PointStream {
 public:
  RoundedStream(PointStream& sorted, double unit, const Executor& executor, const MortonKey& before,
                const PointRounding& rounding)
      : sorted_(sorted), unit_(unit), executor_(executor), rounding_(rounding), last_(before) {}

  std::size_t next(std::span<PointRecord> out) override {
    // Round all pieces, each as if it were the first.
    const std::size_t count = sorted_.next(out);
    exact_.resize(count);
    executor_.for_ranges(count, kGrain, [&](std::size_t begin, std::size_t end) {
      MortonKey before;  // as if there were no point before
      for (std::size_t i = begin; i < end; ++i) {
        exact_[i] = out[i].key;
        round(out[i], before);
        before = out[i].key;
      }
    });
    // Correct the beginning of each piece: the true point before may change the position of its
    // first point, and that the position of the next.
    for (std::size_t begin = 0; begin < count; begin += kGrain) {
      for (std::size_t i = begin; i < count; ++i) {
        const MortonKey key =
            rounded_key(exact_[i], out[i].radius, i == 0 ? last_ : out[i - 1].key);
        if (key == out[i].key) break;
        out[i].key = key;
      }
    }
    if (count > 0) last_ = out[count - 1].key;
    return count;
  }

 private:
  static constexpr std::size_t kGrain = 2048;  // points of a piece

  /// Rounds a point. @param before  position of the rounded point before it
  void round(PointRecord& point, const MortonKey& before) const noexcept {
    point.radius = rounded_radius(point.radius, rounding_.radius_bits);
    for (std::int16_t& component : point.normal)
      component = rounded_normal(component, rounding_.normal_bits);
    for (std::uint16_t& half : point.radiance)
      half = rounded_radiance(half, rounding_.radiance_bits);
    for (std::uint16_t& half : point.emission)
      half = rounded_radiance(half, rounding_.radiance_bits);
    point.key = rounded_key(point.key, point.radius, before);
  }

  /// Returns the low corner of the largest cell around the point whose diagonal is at most
  /// PointRounding::position radii. If that corner precedes the previous point on the curve, a
  /// smaller cell is taken, in the end the point itself.
  [[nodiscard]] MortonKey rounded_key(const MortonKey& key, float radius,
                                      const MortonKey& before) const noexcept {
    const double edge = static_cast<double>(radius) / unit_ * (rounding_.position / std::sqrt(3.0));
    const int exponent = static_cast<int>(std::bit_cast<std::uint64_t>(edge) >> 52) - 1023;
    int level = edge >= 1 ? std::max(kLatticeBits - exponent, 0) : kLatticeBits;
    while (cell_of(key, level) < before) ++level;
    return cell_of(key, level);
  }

  PointStream& sorted_;
  double unit_;
  const Executor& executor_;
  PointRounding rounding_;
  std::vector<MortonKey> exact_;  ///< the keys of the points being rounded, before rounding
  MortonKey last_;                ///< the rounded key of the last point handed out
};

}  // namespace

Codec codec_of(Profile profile) noexcept {
  if (profile == Profile::raw) return Codec::raw;
  return profile == Profile::fast ? Codec::lz4 : Codec::zstd;
}

bool is_rounded(Profile profile) noexcept {
  return profile == Profile::fast || profile == Profile::compact;
}

std::unique_ptr<PointStream> round_points(PointStream& sorted, double unit,
                                          const Executor& executor, const MortonKey& before,
                                          const PointRounding& rounding) {
  return std::make_unique<RoundedStream>(sorted, unit, executor, before, rounding);
}

std::string rounding_text(const PointRounding& rounding) {
  // A step along u and v of an octahedral normal turns it by at most 1.57 and sqrt(2) steps [rad]
  const double turn =
      kRoundedNormal * std::exp2(PointRounding{}.normal_bits - rounding.normal_bits);
  return fmt::format("position {:.2g} radius, radius 1/{}, normal {:.2g}, radiance 1/{}",
                     rounding.position, 2 << rounding.radius_bits, turn,
                     2 << rounding.radiance_bits);
}

}  // namespace ptc
