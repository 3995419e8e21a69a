// Samples are added with their weights, so the layers are means at any time. Estimated errors are
// averaged as squares: the error of a mean is at most the root mean square of the errors, whether
// the errors of the samples have the same sign or not.
#include "engine/pipeline/render/film.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace ptc {
namespace {

/// Returns the components of all pixels one after another, as image files take them.
std::span<const float> flat(const std::vector<glm::vec3>& values) {
  static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
  return {values.empty() ? nullptr : &values.front().x, values.size() * 3};
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
  if (extras.irradiance) irradiance_.resize(pixels, glm::vec3(0));
  for (const std::string& name : extras.shadows)
    shadows_.emplace_back(name, std::vector<float>(pixels));
}

std::uint64_t Film::pixel_bytes(const FilmExtras& extras) noexcept {
  return 5 * sizeof(glm::vec3) + (extras.estimates ? 4 : 2) * sizeof(float) +
         (extras.glossy ? sizeof(glm::vec3) + sizeof(float) : 0) +
         (extras.irradiance ? sizeof(glm::vec3) : 0) + extras.shadows.size() * sizeof(float);
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
  if (!hit.is_margin) alpha_[pixel] += weight;
  if (!irradiance_.empty())
    irradiance_[pixel] += weight * (hit.lamps + shading.sky + shading.irradiance);
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

void Film::add_group(const std::string& layer, const Film& group, unsigned first) {
  // Light adds up
  const auto at = std::ptrdiff_t{first} * width_;
  const auto add = [at](std::vector<glm::vec3>& to, const std::vector<glm::vec3>& light) {
    std::transform(light.begin(), light.end(), to.begin() + at, to.begin() + at, std::plus<>());
  };
  add(beauty_, group.beauty_);
  add(direct_, group.direct_);
  add(indirect_, group.indirect_);

  // The rest is the same for all groups
  const auto take = [at](auto& to, const auto& from) { std::ranges::copy(from, to.begin() + at); };
  take(bent_normal_, group.bent_normal_);
  take(albedo_, group.albedo_);
  take(occlusion_, group.occlusion_);
  take(alpha_, group.alpha_);
  auto own =
      std::ranges::find(groups_, layer, &std::pair<std::string, std::vector<glm::vec3>>::first);
  if (own == groups_.end())
    own = groups_.insert(own, {layer, std::vector<glm::vec3>(beauty_.size(), glm::vec3(0))});
  take(own->second, group.beauty_);
}

void Film::finish() {
  for (auto* layer : {&occlusion_error_, &irradiance_error_}) {
    for (float& value : *layer) value = std::sqrt(value);
  }
}

std::vector<Film::Layer> Film::layers() const {
  using Kind = ExrLayerType::Kind;
  std::vector<Layer> layers{{{"", Kind::colour, false}, flat(beauty_)},
                            {{"direct", Kind::colour, false}, flat(direct_)},
                            {{"indirect", Kind::colour, false}, flat(indirect_)},
                            {{"albedo", Kind::colour, false}, flat(albedo_)},
                            {{"occlusion", Kind::scalar, false}, occlusion_},
                            {{"alpha", Kind::scalar, false}, alpha_},
                            {{"bent_normal", Kind::vector, true}, flat(bent_normal_)}};
  if (!occlusion_error_.empty()) {
    layers.push_back({{"occlusion_error", Kind::scalar, true}, occlusion_error_});
    layers.push_back({{"irradiance_error", Kind::scalar, true}, irradiance_error_});
  }
  if (!reflection_.empty()) {
    layers.push_back({{"reflection", Kind::colour, false}, flat(reflection_)});
    layers.push_back({{"reflection_occlusion", Kind::scalar, false}, reflection_occlusion_});
  }
  if (!irradiance_.empty())
    layers.push_back({{"irradiance", Kind::colour, false}, flat(irradiance_)});
  for (const auto& [name, shadow] : shadows_)
    layers.push_back({{name, Kind::scalar, false}, shadow});
  for (const auto& [name, light] : groups_)
    layers.push_back({{name, Kind::colour, false}, flat(light)});
  return layers;
}

std::vector<glm::vec3> Film::shown(std::string_view layer, unsigned row, unsigned rows) const {
  const std::size_t first = std::size_t{row} * width_, count = std::size_t{rows} * width_;
  std::vector<glm::vec3> pixels;
  if (layer == "occlusion") {
    pixels.reserve(count);
    for (const float occlusion : std::span(occlusion_).subspan(first, count))
      pixels.emplace_back(1 - occlusion);
    return pixels;
  }
  const std::vector<glm::vec3>& from = layer == "direct"       ? direct_
                                       : layer == "indirect"   ? indirect_
                                       : layer == "albedo"     ? albedo_
                                       : layer == "reflection" ? reflection_
                                       : layer == "irradiance" ? irradiance_
                                                               : beauty_;
  const std::span<const glm::vec3> part = std::span(from).subspan(first, count);
  pixels.assign(part.begin(), part.end());
  if (layer == "irradiance") {
    for (glm::vec3& pixel : pixels) pixel *= std::numbers::inv_pi_v<float>;
  }
  return pixels;
}

}  // namespace ptc
