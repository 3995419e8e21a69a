// Completes scans: normals, radii and outliers of point clouds that lack them.
//
//     sorted records --> temporary files --> chunks: neighbours, fits, votes --> islands
//                                                                                  |
//     records with normals and radii, in the same order  <-------------------------+
//
// All of it streams along the Z-curve: memory holds a few chunks, an index of 48 bytes for every
// few hundred points, and what is still open about the sides of normals.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/base/stream.h"
#include "format/morton.h"

namespace ptc {

/// Bit of PointRecord::flags of a point whose normal is unknown. The four bytes of `normal` then
/// hold the number of its scanner, or kNoScanner.
inline constexpr std::uint8_t kUnknownNormal = 1;
/// The scanner's number of a point that names none.
inline constexpr std::uint32_t kNoScanner = 0xffffffff;

/// What is known of a cloud, and the resources for completing it.
struct ScanOptions {
  /// The cap on all memory of complete_scan() and the stream that it returns.
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  /// The directories of temporary files, at least one. They take 80 bytes for each point.
  std::vector<std::filesystem::path> temp_dirs{"."};
  bool radii = true;  ///< whether points whose radius is 0 get one
  /// Places of the scanners in scene units, by number. A normal turns to the scanner of its point.
  std::vector<glm::dvec3> scanners;
  glm::dvec3 up{0, 0, 1};  ///< the axis that points up; any length above 0
  /// Whether the cloud was seen from above, so that the normals of points without a scanner turn
  /// upwards.
  bool aerial = false;
};

/// What complete_scan() and its stream did so far.
struct ScanReport {
  std::uint64_t points = 0;      ///< records that were read
  std::uint64_t duplicates = 0;  ///< of them, points at the position of another one before them
  std::uint64_t normals = 0;     ///< unknown normals
  std::uint64_t islands = 0;     ///< connected parts whose side followed from their shape alone,
                                 ///< for want of a scanner, neighbours and a sky
  // The counts below grow while the stream is read.
  std::uint64_t radii = 0;     ///< radii that were estimated
  std::uint64_t outliers = 0;  ///< points that are marked as outliers
  std::uint64_t alone = 0;     ///< points without neighbours, whose radius stays 0
};

/// Bits of the marks of points. The upper six say how far a receiver must rise above the point to
/// stand clear of the noise of its surface, in eighths of the radius.
enum PointMark : std::uint8_t {
  kOutlier = 1,    ///< far from all neighbours, compared with the spacing around it
  kDuplicate = 2,  ///< at the position of the point before it
};
inline constexpr unsigned kRiseShift = 2;      ///< of the rise in a mark
inline constexpr std::uint8_t kMostRise = 63;  ///< the greatest rise, eighths of the radius

/// The points of a completed scan.
class ScanStream : public PointStream {
 public:
  /// Returns the marks of the points that next() returned last, bits of PointMark. Valid until the
  /// next call of next().
  [[nodiscard]] virtual std::span<const std::uint8_t> marks() const noexcept = 0;
};

/// Takes all points and yields them in the same order, with a normal where it was unknown, a radius
/// where it was 0, and flags of 0.
///
///   - A normal is that of a quadratic surface through the nearest points: 16, or 48 where these
///     are noisy or lie on a line. Neighbours off the surface, as beyond an edge, count less.
///   - Normals turn to the scanner where its place is known, upwards in aerial scans, and
///     otherwise so that neighbours agree, and the side that is in the open, or sees more of the
///     sky, is the front. A connected part without any hint turns outwards, or upwards where it is
///     an open sheet.
///   - A radius lets the disc circumscribe the cell of its point; between scan lines it reaches
///     half-way to the next line. It is 0 for a cloud of coincident points.
///   - Points that coincide count as one, and get the same normal and radius.
///   - Outliers are marked, and stay.
///
/// The result depends on the points and the options alone, not on memory or threads.
/// @param sorted    points by ascending key; is read to its end in the call
/// @param executor  runs the loops of the call
/// @param progress  gets the stages "spool" and "normals"
/// @param report    must outlive the stream
/// @throws LimitError when the cap is too small; std::system_error, DataError of temporary files
[[nodiscard]] std::unique_ptr<ScanStream> complete_scan(PointStream& sorted, const Frame& frame,
                                                        const ScanOptions& options,
                                                        const Executor& executor,
                                                        Progress& progress, ScanReport& report);

}  // namespace ptc
