#include "engine/pipeline/render/thumbnail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/progress.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/convert/level_source.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/point_scan.h"
#include "format/morton.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMostPoints = 2'000'000;  // that are read themselves
constexpr unsigned kLevel = 9;                    // of the clusters in their place
constexpr unsigned kSide = 2;                     // samples along the side of a pixel

std::unique_ptr<PrimaryView> view_of(const ContainerReader& scene, const Camera& camera,
                                     const Executor& executor) {
  Progress silent;
  if (scene.superblock().points <= kMostPoints)
    return view_surfels(scene, camera, {.side = kSide}, executor, silent);
  return view_surfels(scene, *open_level(scene, kLevel, {}), camera, kSide, executor);
}

/// The colours of a scene as an even share of its point pages tells them: clusters have none.
class SampledColours {
 public:
  explicit SampledColours(const ContainerReader& scene) : frame_(scene.header().frame) {
    constexpr std::size_t kMostPages = 4096;
    constexpr std::uint32_t kRuns = 8;  // of a page, whose points lie along the curve
    const std::size_t step = scene.point_pages().size() / kMostPages + 1;
    for (PointScan scan(scene); scan.next(); scan.skip(step - 1)) {
      const PointPage page = scan.points();
      const std::uint32_t run = (page.size() + kRuns - 1) / kRuns;
      for (std::uint32_t begin = 0; begin < page.size(); begin += run) {
        const std::uint32_t end = std::min(begin + run, page.size());
        glm::vec3 sum(0);
        for (std::uint32_t i = begin; i < end; ++i) {
          const std::array<std::uint8_t, 3> albedo = page.albedo(i);
          sum += glm::vec3(albedo[0], albedo[1], albedo[2]);
        }
        keys_.push_back(encode_morton(page.position(begin)));
        colours_.push_back(sum / (255 * static_cast<float>(end - begin)));
      }
    }
  }

  /// Returns the colour of the points that lie before a place on the curve.
  [[nodiscard]] glm::vec3 at(const glm::dvec3& position) const {
    const MortonKey key = encode_morton(frame_.to_lattice({position.x, position.y, position.z}));
    const auto after = std::ranges::upper_bound(keys_, key) - keys_.begin();
    return colours_[static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - 1, 0))];
  }

 private:
  Frame frame_;
  std::vector<MortonKey> keys_;  ///< ascending
  std::vector<glm::vec3> colours_;
};

/// Returns the colour of what a sample sees.
/// @param along   unit, from the camera
/// @param is_lit  surfels have light of their own
/// @param shown   null: surfels have their own colours
glm::vec3 colour_of(const PrimaryHit& hit, const glm::vec3& along, bool is_lit,
                    const SampledColours* shown) {
  if (is_lit) return hit.direct;
  const float facing = std::abs(glm::dot(hit.normal, along));
  return (shown ? shown->at(hit.position) : hit.albedo) * (0.25F + 0.75F * facing);
}

/// Returns the factor that makes the 98th percentile of the brightness of what is seen 1.
float gain_of(const std::vector<glm::vec3>& seen) {
  std::vector<float> brightness;
  for (const glm::vec3& c : seen) {
    const float most = std::max({c.r, c.g, c.b});
    if (most > 0) brightness.push_back(most);
  }
  if (brightness.empty()) return 1;
  const auto place = brightness.begin() + static_cast<std::ptrdiff_t>(brightness.size() * 98 / 100);
  std::ranges::nth_element(brightness, place);
  return 1 / *place;
}

}  // namespace

void write_thumbnail(const ContainerReader& scene, const std::filesystem::path& target,
                     const Executor& executor) {
  // See the scene
  constexpr glm::vec3 kBackground(0.8F);
  constexpr float kShare = 1.0F / (kSide * kSide);
  const Camera camera =
      default_camera(scene, {}, {}, std::array{kThumbnailWidth, kThumbnailHeight});
  const std::unique_ptr<PrimaryView> view = view_of(scene, camera, executor);
  const bool is_lit = scene.superblock().flux != std::array<double, 3>{};
  std::optional<SampledColours> shown;
  if (!is_lit && scene.superblock().points > kMostPoints && has_colours(scene.meta().text))
    shown.emplace(scene);

  // Average the samples of each pixel
  Image image{.width = kThumbnailWidth, .height = kThumbnailHeight};
  image.pixels.assign(std::size_t{image.width} * image.height, glm::vec3(0));
  std::vector<float> open(image.pixels.size());  // share that is background
  for (unsigned y = 0; y < image.height * kSide; ++y) {
    for (unsigned x = 0; x < image.width * kSide; ++x) {
      const std::size_t pixel = std::size_t{y / kSide} * image.width + x / kSide;
      const auto hit = view->at(x, y);
      if (!hit) {
        open[pixel] += kShare;
        continue;
      }
      const auto along = glm::normalize(glm::vec3(hit->position - camera.position));
      image.pixels[pixel] += kShare * colour_of(*hit, along, is_lit, shown ? &*shown : nullptr);
    }
  }
  const float gain = gain_of(image.pixels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = glm::min(image.pixels[i] * gain, glm::vec3(1)) + open[i] * kBackground;
  write_png(target, image);
}

}  // namespace ptc
