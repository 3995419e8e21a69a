#include "engine/pipeline/light/relit_points.h"

#include <algorithm>

namespace ptc {

PointRange points_of(const ContainerReader& scene, std::optional<std::size_t> part) {
  if (!part) return {0, scene.superblock().points};
  PointRange range;
  for (std::size_t i = 0; i < *part; ++i) range.first += scene.parts()[i]->superblock().points;
  range.end = range.first + scene.parts()[*part]->superblock().points;
  return range;
}

RelitPoints::RelitPoints(const ContainerReader& scene, const PointRange& range, Progress& progress)
    : range_(range),
      progress_(progress),
      points_(scene),
      records_(kBatch),
      batch_(range.first / kBatch * kBatch) {
  points_.skip(batch_);
}

std::size_t RelitPoints::next(std::span<PointRecord> out) {
  if (at_ == end_ && batch_ < range_.end) {
    const auto batch = std::span(records_).first(points_.next(records_));
    relight(batch, batch_);
    const auto in_batch = [&](std::uint64_t point) {
      return static_cast<std::size_t>(
          std::clamp<std::uint64_t>(point, batch_, batch_ + batch.size()) - batch_);
    };
    at_ = in_batch(range_.first);
    end_ = in_batch(range_.end);
    batch_ += batch.size();
  }
  const std::size_t count = std::min(out.size(), end_ - at_);
  std::copy_n(records_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
  at_ += count;
  progress_.advance(count);
  return count;
}

}  // namespace ptc
