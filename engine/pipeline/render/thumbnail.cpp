#include "engine/pipeline/render/thumbnail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/progress.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/convert/level_source.h"
#include "engine/pipeline/render/primary.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMostPoints = 2'000'000;  // that are read themselves
constexpr unsigned kLevel = 9;                    // of the clusters in their place
constexpr unsigned kSide = 2;                     // samples along the side of a pixel

std::unique_ptr<PrimaryView> view_of(const ContainerReader& scene, const Camera& camera,
                                     const Executor& executor) {
  Progress silent;
  if (scene.superblock().points <= kMostPoints)
    return view_surfels(scene, camera, kSide, 0, nullptr, executor, silent);
  return view_surfels(scene, *open_level(scene, kLevel, {}), camera, kSide, executor);
}

/// Returns the colour of what a sample sees.
/// @param along   unit, from the camera
/// @param is_lit  surfels have light of their own
glm::vec3 colour_of(const PrimaryHit& hit, const glm::vec3& along, bool is_lit) {
  if (is_lit) return hit.direct;
  const float facing = std::abs(glm::dot(hit.normal, along));
  return hit.albedo * (0.25F + 0.75F * facing);
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
      default_camera(scene, {}, false, std::array{kThumbnailWidth, kThumbnailHeight});
  const std::unique_ptr<PrimaryView> view = view_of(scene, camera, executor);
  const bool is_lit = scene.superblock().flux != std::array<double, 3>{};

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
      image.pixels[pixel] += kShare * colour_of(*hit, along, is_lit);
    }
  }
  const float gain = gain_of(image.pixels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = glm::min(image.pixels[i] * gain, glm::vec3(1)) + open[i] * kBackground;
  write_png(target, image);
}

}  // namespace ptc
