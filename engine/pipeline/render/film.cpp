// Samples are added with their weights, so the layers are means at any time. Estimated errors are
// averaged as squares: the error of a mean is at most the root mean square of the errors, whether
// the errors of the samples have the same sign or not.
#include "engine/pipeline/render/film.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "engine/io/image/image.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

/// Returns the components of all pixels one after another, as image files take them.
std::vector<float> flatten(const std::vector<glm::vec3>& values) {
  std::vector<float> flat;
  flat.reserve(values.size() * 3);
  for (const glm::vec3& v : values) flat.insert(flat.end(), {v.x, v.y, v.z});
  return flat;
}

}  // namespace

Film::Film(unsigned width, unsigned height, const FilmExtras& extras)
    : width_(width), height_(height) {
  const std::size_t pixels = std::size_t{width} * height;
  for (auto* layer : {&beauty_, &direct_, &indirect_, &bent_normal_, &albedo_}) {
    layer->resize(pixels, glm::vec3(0));
  }
  for (auto* layer : {&occlusion_, &alpha_}) layer->resize(pixels, 0);
  if (extras.estimates) {
    for (auto* layer : {&occlusion_error_, &irradiance_error_}) layer->resize(pixels, 0);
  }
  if (extras.glossy) {
    reflection_.resize(pixels, glm::vec3(0));
    reflection_occlusion_.resize(pixels, 0);
  }
  for (const std::string& name : extras.shadows)
    shadows_.emplace_back(name, std::vector<float>(pixels));
}

std::uint64_t Film::pixel_bytes(const FilmExtras& extras) noexcept {
  return 5 * sizeof(glm::vec3) + (extras.estimates ? 4 : 2) * sizeof(float) +
         (extras.glossy ? sizeof(glm::vec3) + sizeof(float) : 0) +
         extras.shadows.size() * sizeof(float);
}

void Film::add(std::size_t pixel, const PrimaryHit& hit, const Shading& shading, float weight) {
  const glm::vec3 reflect = hit.albedo * std::numbers::inv_pi_v<float>;
  const glm::vec3 lit = hit.direct + (hit.sky_included ? glm::vec3(0) : reflect * shading.sky);
  const glm::vec3 bounced = reflect * shading.irradiance;
  direct_[pixel] += weight * lit;
  indirect_[pixel] += weight * bounced;
  beauty_[pixel] += weight * (lit + bounced);
  bent_normal_[pixel] += weight * shading.bent_normal;
  albedo_[pixel] += weight * hit.albedo;
  occlusion_[pixel] += weight * shading.occlusion;
  alpha_[pixel] += weight;
}

void Film::add(std::size_t pixel, const ErrorEstimate& estimate, float weight) {
  occlusion_error_[pixel] += weight * estimate.occlusion * estimate.occlusion;
  irradiance_error_[pixel] += weight * estimate.irradiance * estimate.irradiance;
}

void Film::add(std::size_t pixel, const Reflection& reflection, float weight) {
  reflection_[pixel] += weight * reflection.radiance;
  reflection_occlusion_[pixel] += weight * reflection.occlusion;
}

void Film::add(std::size_t pixel, std::span<const float> shadows, float weight) {
  for (std::size_t i = 0; i < shadows.size(); ++i) shadows_[i].second[pixel] += weight * shadows[i];
}

void Film::add_group(const std::string& layer, const Film& group) {
  const auto add = [](std::vector<glm::vec3>& to, const std::vector<glm::vec3>& light) {
    std::ranges::transform(to, light, to.begin(), std::plus<>());
  };
  add(beauty_, group.beauty_);
  add(direct_, group.direct_);
  add(indirect_, group.indirect_);
  bent_normal_ = group.bent_normal_;
  albedo_ = group.albedo_;
  occlusion_ = group.occlusion_;
  alpha_ = group.alpha_;
  groups_.emplace_back(layer, group.beauty_);
}

void Film::finish() {
  for (auto* layer : {&occlusion_error_, &irradiance_error_}) {
    for (float& value : *layer) value = std::sqrt(value);
  }
}

void Film::write(std::span<const PictureTarget> targets, float exposure) const {
  for (const PictureTarget& target : targets) {
    if (lower_extension(target.path) == ".exr") {
      write_exr(target.path);
    } else {
      write_png(target, exposure);
    }
  }
}

void Film::write_exr(const std::filesystem::path& target) const {
  using Kind = ExrLayer::Kind;
  std::vector<ExrLayer> layers{{"", Kind::colour, false, flatten(beauty_)},
                               {"direct", Kind::colour, false, flatten(direct_)},
                               {"indirect", Kind::colour, false, flatten(indirect_)},
                               {"albedo", Kind::colour, false, flatten(albedo_)},
                               {"occlusion", Kind::scalar, false, occlusion_},
                               {"alpha", Kind::scalar, false, alpha_},
                               {"bent_normal", Kind::vector, true, flatten(bent_normal_)}};
  if (!occlusion_error_.empty()) {
    layers.push_back({"occlusion_error", Kind::scalar, true, occlusion_error_});
    layers.push_back({"irradiance_error", Kind::scalar, true, irradiance_error_});
  }
  if (!reflection_.empty()) {
    layers.push_back({"reflection", Kind::colour, false, flatten(reflection_)});
    layers.push_back({"reflection_occlusion", Kind::scalar, false, reflection_occlusion_});
  }
  for (const auto& [name, shadow] : shadows_) layers.push_back({name, Kind::scalar, false, shadow});
  for (const auto& [name, light] : groups_)
    layers.push_back({name, Kind::colour, false, flatten(light)});
  ptc::write_exr(target, width_, height_, layers);
}

void Film::write_png(const PictureTarget& target, float exposure) const {
  Image image{.width = width_, .height = height_};
  if (target.layer == "occlusion") {
    for (const float occlusion : occlusion_) image.pixels.emplace_back(1 - occlusion);
  } else {
    image.pixels = target.layer == "direct"       ? direct_
                   : target.layer == "indirect"   ? indirect_
                   : target.layer == "albedo"     ? albedo_
                   : target.layer == "reflection" ? reflection_
                                                  : beauty_;
    const float gain = target.layer == "albedo" ? 1 : std::exp2(exposure);
    for (glm::vec3& pixel : image.pixels) pixel *= gain;
  }
  ptc::write_png(target.path, image);
}

}  // namespace ptc
