// The profiles in which a container stores points, and the rounding that two of them apply
// (spec/points.md#rounding).
#pragma once

#include <memory>
#include <string>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "format/container.h"
#include "format/point_record.h"

namespace ptc {

/// How points are stored.
enum class Profile {
  raw,      ///< exact, neither packed nor compressed, so that pages can be used where they lie
  exact,    ///< exact, packed, zstd
  fast,     ///< rounded, packed, LZ4: decodes fastest
  compact,  ///< rounded, packed, zstd: smallest
};

/// Returns the codec of a profile.
[[nodiscard]] Codec codec_of(Profile profile) noexcept;
/// Returns whether a profile rounds points.
[[nodiscard]] bool is_rounded(Profile profile) noexcept;

/// How coarsely points are stored.
struct PointRounding {
  double position = 0.001;  ///< greatest distance that a point moves, in rounded radii
  int radius_bits = 8;      ///< of a radius behind the leading one, 1 to 22
  int normal_bits = 10;     ///< of a component of a normal besides its sign, 1 to 14
  int radiance_bits = 7;    ///< of radiance and emission behind the leading one, 1 to 9

  friend bool operator==(const PointRounding&, const PointRounding&) = default;
};

/// The greatest distance that the profiles move a point, in rounded radii.
inline constexpr double kRoundedPosition = PointRounding{}.position;
/// The greatest relative change of a radius by the profiles.
inline constexpr double kRoundedRadius = 1.0 / 512;
/// The greatest angle by which the profiles turn a normal [rad].
inline constexpr double kRoundedNormal = 0.0021;
/// The greatest relative change of radiance by the profiles; the absolute change may be 2^-22 if
/// that is more.
inline constexpr double kRoundedRadiance = 1.0 / 256;

/// Returns the four bounds of a rounding in words, as the meta page of a rounded container records
/// them.
[[nodiscard]] std::string rounding_text(const PointRounding& rounding = {});

/// Returns a stream of the same points, rounded. Their order stays. Rounding rounded points changes
/// nothing. Points of radius 0 keep their position.
/// @param sorted, executor  must outlive the result
/// @param unit              lattice unit in scene units
/// @param before            key of the rounded point before the first; zero when there is none
/// @param rounding          that of the profiles, unless it says otherwise
[[nodiscard]] std::unique_ptr<PointStream> round_points(PointStream& sorted, double unit,
                                                        const Executor& executor,
                                                        const MortonKey& before = {},
                                                        const PointRounding& rounding = {});

}  // namespace ptc
