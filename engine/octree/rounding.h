// How a container keeps its points, and what rounding them may lose (spec/points.md#rounding).
#pragma once

#include <memory>

#include "engine/sort/external_sort.h"
#include "format/container.h"

namespace ptc {

enum class Profile {
  raw,      ///< exact, neither packed nor compressed: for reading in place
  exact,    ///< exact, packed, zstd
  fast,     ///< rounded, packed, LZ4: decodes fastest
  compact,  ///< rounded, packed, zstd: smallest
};

[[nodiscard]] Codec codec_of(Profile profile) noexcept;
[[nodiscard]] bool is_rounded(Profile profile) noexcept;

/// What rounding takes at most from a point.
inline constexpr double kRoundedPosition = 0.001;      ///< distance, of the rounded radius
inline constexpr double kRoundedRadius = 1.0 / 512;    ///< share
inline constexpr double kRoundedNormal = 0.0021;       ///< angle, rad
inline constexpr double kRoundedRadiance = 1.0 / 256;  ///< share, or 2^-22 if that is more

/// The same in words.
inline constexpr const char* kRounding =
    "position 0.001 radius, radius 1/512, normal 0.0021, radiance 1/256";

/// Rounds sorted points; their order stays. Rounding what is rounded changes nothing. Points of
/// radius 0 keep their position.
/// @param sorted, executor  must outlive the result
/// @param unit              lattice unit in scene units
/// @param before            key of the rounded point before the first; none: zero
[[nodiscard]] std::unique_ptr<PointStream> round_points(PointStream& sorted, double unit,
                                                        const Executor& executor,
                                                        const MortonKey& before = {});

}  // namespace ptc
