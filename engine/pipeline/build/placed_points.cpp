#include "engine/pipeline/build/placed_points.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "engine/io/cloud/las_vlrs.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/placed_sampler.h"

namespace ptc {
namespace {

class PlacedPoints final : public PointSource {
 public:
  PlacedPoints(std::unique_ptr<PointSource> source, const Placement& place)
      : source_(std::move(source)), place_(place), move_(place) {}

  std::size_t next(std::span<Surfel> out) override {
    const std::size_t count = source_->next(out);
    for (Surfel& surfel : out.first(count)) surfel = move_.of(surfel);
    return count;
  }
  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override {
    return source_->attributes();
  }
  [[nodiscard]] std::optional<Extent> extent() override {
    std::optional<Extent> extent = source_->extent();
    if (!extent) return extent;
    extent->bounds = placed_bounds(extent->bounds, place_);
    for (glm::dvec3& position : extent->sample) position = place_ * glm::dvec4(position, 1);
    return extent;
  }
  [[nodiscard]] std::uint64_t left_out() const noexcept override { return source_->left_out(); }

 private:
  std::unique_ptr<PointSource> source_;
  Placement place_;
  SurfelMove move_;
};

}  // namespace

PointFile open_placed_points(const std::filesystem::path& path, const Selection& selection,
                             const std::optional<Placement>& place) {
  PointFile file = open_point_input(path, selection);
  if (!place) return file;
  for (glm::dvec3& scanner : file.info.scanners) scanner = *place * glm::dvec4(scanner, 1);
  std::map<std::string, std::string>& text = file.info.text;
  for (const char* key : {kCrsKey, kLasRecordsKey, kViewpointKey, kCameraKey}) text.erase(key);
  const double size = size_of(*place);
  if (size != 1) text.erase(kUnitKey);
  if (glm::dmat3(*place) != glm::dmat3(size)) text.erase(kUpKey);
  if (const auto lights = text.find(kLightsKey); lights != text.end())
    lights->second = to_json(placed_lights(light_rig_from_json(lights->second), *place));
  file.source = std::make_unique<PlacedPoints>(std::move(file.source), *place);
  return file;
}

}  // namespace ptc
