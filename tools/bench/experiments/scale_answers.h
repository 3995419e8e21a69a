// The answers that all runs of `ptcbench scale` must give, whatever time they take.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>

#include "engine/verify/verify.h"

namespace ptc::bench {

/// The answers of one run from a procedural city to shaded receivers.
struct ScaleAnswers {
  std::uint64_t points = 0;
  std::array<std::uint64_t, 2> content{};  ///< digest of the container (Superblock::content_xxh3)
  std::uint64_t values = 0;                ///< digest of the shaded receivers (digest_of_values())
};

/// Checks a container against the points that were asked for and sorted.
/// @param asked   points asked of the city, 1000 or more; it has this many within 5 % (make_city())
/// @param sorted  points that went through the sort
/// @throws DataError when the container is not sound, or holds another number of points
void require_whole(const VerifyReport& report, std::uint64_t asked, std::uint64_t sorted);

/// Checks that two runs of one size gave the same answers. @throws DataError naming what differs
void require_same(const ScaleAnswers& first, const ScaleAnswers& now);

/// Returns a digest of the points of a binary PLY as create_points() writes it.
/// @param points  number of points that it must hold
/// @throws DataError naming file, point and property when a value is not finite, or the file when
///         the number of points differs; std::system_error
/// Memory: the size of the file.
[[nodiscard]] std::uint64_t digest_of_values(const std::filesystem::path& ply,
                                             std::uint64_t points);

}  // namespace ptc::bench
