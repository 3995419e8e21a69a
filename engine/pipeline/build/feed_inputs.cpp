#include "engine/pipeline/build/feed_inputs.h"

#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "engine/io/cloud/record.h"
#include "engine/pipeline/build/placed_points.h"
#include "engine/scene/procedural/city.h"

namespace ptc {
namespace {

/// Returns the number of a point's scanner among all of the inputs.
/// @param row  the attributes of the point
std::uint32_t scanner_of(const Clouds::Cloud& cloud, const std::byte* row) {
  if (cloud.first_scanner == kNoScanner) return kNoScanner;
  std::uint32_t own = 0;
  std::memcpy(&own, row + cloud.scanner_offset, cloud.scanner_bytes);
  return cloud.first_scanner + own;
}

/// Marks a record whose normal is to be estimated.
void mark_unknown_normal(PointRecord& record, std::uint32_t scanner) {
  static_assert(sizeof record.normal == sizeof scanner);
  std::memcpy(record.normal.data(), &scanner, sizeof scanner);
  record.flags = kUnknownNormal;
}

/// The sorts of a build, which take the points of one source after another.
class Feeder {
 public:
  /// @param first  number of the first point among all of the container
  Feeder(const AttributePlan& plan, const Frame& frame, std::uint64_t first, ExternalSorter& sorter,
         AttributeSorts& attributes, const Executor& executor, Progress& progress)
      : plan_(plan),
        frame_(frame),
        sorter_(sorter),
        attributes_(attributes),
        executor_(executor),
        progress_(progress),
        points_(first) {}

  /// Feeds all points of a source. @return the number of points
  /// @param cloud  what is known of the source; the default: it has no channels
  std::uint64_t feed(PointSource& source, const Clouds::Cloud& cloud = {}) {
    const std::uint64_t before = points_;
    while (const std::size_t count = source.next(surfels_)) {
      const std::span<const std::byte> rows = source.attributes();
      const std::size_t row_bytes = rows.size() / count;
      if (cloud.said) require_within(*cloud.said, count, cloud.path);
      executor_.for_ranges(count, 1 << 11, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          records_[i] = to_record(surfels_[i], frame_);
          if (surfels_[i].normal == glm::vec3(0))
            mark_unknown_normal(records_[i], scanner_of(cloud, rows.data() + i * row_bytes));
        }
      });
      const auto block = std::span<const PointRecord>(records_).first(count);
      sorter_.add(block);
      attributes_.add(plan_, block, cloud.input, rows, points_);
      points_ += count;
      progress_.advance(count);
    }
    return points_ - before;
  }

 private:
  /// Compares the surfels that were read last with what their file says of their place.
  void require_within(const Bounds& said, std::size_t count, const std::filesystem::path& path) {
    for (std::size_t i = 0; i < count; ++i) {
      if (!said.contains(surfels_[i].position))
        throw BoundsExceeded(path.string() + ": a point lies outside the bounds of its header");
    }
  }

  const AttributePlan& plan_;
  const Frame& frame_;
  ExternalSorter& sorter_;
  AttributeSorts& attributes_;
  const Executor& executor_;
  Progress& progress_;
  std::vector<Surfel> surfels_ = std::vector<Surfel>(kSurfelBlock);
  std::vector<PointRecord> records_ = std::vector<PointRecord>(kSurfelBlock);
  std::uint64_t points_;  ///< number of the next point
};

}  // namespace

double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   std::uint64_t first, const SamplingRoom& room, ExternalSorter& sorter,
                   AttributeSorts& attributes, const Executor& executor, Progress& progress) {
  Feeder feeder(inputs.attributes, frame, first, sorter, attributes, executor, progress);
  if (request.city_points > 0) feeder.feed(*make_city(request.city_points));
  for (const Clouds::Cloud& cloud : inputs.clouds.files) {
    const PointFile file = open_placed_points(cloud.path, request.selection, cloud.place);
    if (feeder.feed(*file.source, cloud) == cloud.points) continue;
    throw DataError(cloud.path.string() + ": the file changed while it was read");
  }
  double spacing = 0;
  if (const LitMesh* lit = inputs.lit.get()) {
    SamplingOptions sampling = request.sampling;
    if (!inputs.rays_at_emitters) sampling.lights.area_rays = 0;
    if (sampling.spacing == 0) {
      sampling =
          with_spacing(sampling, seen_area(lit->light, lit->rays, sampling.lights, executor));
    }
    spacing = sampling.spacing;
    sampling.keeps_dark = inputs.keeps_dark;
    feeder.feed(*sample_mesh(lit->light, lit->rays, sampling, executor, room.at_once, lit->first));
    if (lit->first > 0) {
      const std::uint32_t moving = lit->first;
      const LightRig lights = lit->light.rig();
      Mesh mesh = std::move(inputs.lit->mesh);
      inputs.lit.reset();
      inputs.still_light =
          std::make_unique<StillLight>(std::move(mesh), moving, lights, sampling.lights);
    }
  }
  inputs.lit.reset();
  if (const StreamedMeshes* streamed = inputs.streamed.get()) {
    const SamplingOptions sampling = with_spacing(request.sampling, streamed->found.area);
    spacing = sampling.spacing;
    if (streamed->parts.size() > 0) {
      feeder.feed(
          *sample_parts(streamed->parts, streamed->found, sampling, room.streaming, executor));
    }
    if (!streamed->parts.placed().empty()) {
      feeder.feed(
          *sample_placed(streamed->parts, streamed->found, sampling, room.streaming, executor));
    }
  }
  inputs.streamed.reset();
  return spacing;
}

}  // namespace ptc
