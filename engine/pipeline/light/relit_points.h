// The points of a scene with other light than they have, all or those of one part.
//
//   batches   |-------- 65,536 --------|-------- 65,536 --------|-------- 65,536 --------|
//   part                      |====================================|
//   lit       |-------------------------------------------------------------------------|
//
// The light of a point depends a little on those that are lit with it, so that a part lights the
// batches of a pass over all points, and hands out its own points of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/progress.h"
#include "engine/base/stream.h"
#include "engine/shade/shader.h"
#include "engine/store/container_points.h"
#include "engine/store/reader.h"

namespace ptc {

/// A range of the points of a scene, by their numbers without gaps.
struct PointRange {
  std::uint64_t first = 0, end = 0;

  [[nodiscard]] std::uint64_t count() const noexcept { return end - first; }
};

/// Returns the points of a part, or all of them.
/// @param part  index among ContainerReader::parts(); empty: all points
[[nodiscard]] PointRange points_of(const ContainerReader& scene, std::optional<std::size_t> part);

/// The points of a range of a scene, in their order, with the light that a derived class gives
/// them.
class RelitPoints : public PointStream {
 public:
  static constexpr std::size_t kBatch = 16 * Shader::kBlock;  ///< points that are lit at once

  /// @param scene     must outlive this
  /// @param progress  gets the points that are handed out; must outlive this
  RelitPoints(const ContainerReader& scene, const PointRange& range, Progress& progress);

  /// @throws as ContainerPoints::next() and relight()
  std::size_t next(std::span<PointRecord> out) override;

 protected:
  /// Sets what the points of a batch reflect.
  /// @param first  number of the first one, a multiple of kBatch
  virtual void relight(std::span<PointRecord> records, std::uint64_t first) = 0;

 private:
  PointRange range_;
  Progress& progress_;
  ContainerPoints points_;
  std::vector<PointRecord> records_;
  std::uint64_t batch_;           ///< number of the first point of the next batch
  std::size_t end_ = 0, at_ = 0;  ///< behind the last record to hand out, and the next one
};

}  // namespace ptc
