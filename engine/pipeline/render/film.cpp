// Samples are added with their weights, so the layers are means at any time. Estimated errors are
// averaged as squares: the error of a mean is at most the root mean square of the errors, whether
// the errors of the samples have the same sign or not.
#include "engine/pipeline/render/film.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

/// Returns the components of all pixels one after another, as image files take them.
std::span<const float> flat(const std::vector<glm::vec3>& values) {
  static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
  return {values.empty() ? nullptr : &values.front().x, values.size() * 3};
}

/// Returns the linear values that a .png stores as numbers from 0 to 1.
glm::vec3 stored_as(const glm::vec3& numbers) {
  glm::vec3 linear;
  for (int c = 0; c < 3; ++c)
    linear[c] = static_cast<float>(srgb_to_linear(static_cast<double>(numbers[c])));
  return linear;
}

/// Returns a colour whose numbers are (n + 1) / 2; black where there is no normal.
glm::vec3 colour_of_normal(const glm::vec3& normal) {
  return normal == glm::vec3(0) ? glm::vec3(0) : stored_as(0.5F * normal + 0.5F);
}

/// Returns a colour for a number, black for 0. Multiples of the golden ratio spread the hues of
/// numbers that follow one another, those of the plastic number saturation and brightness.
glm::vec3 colour_of_id(float id) {
  if (id == 0) return glm::vec3(0);
  const auto turn = [id](double step) {
    const double turns = step * static_cast<double>(id);
    return static_cast<float>(turns - std::floor(turns));
  };
  const float hue = 6 * turn(0.6180339887498949),
              saturation = 0.5F + 0.4F * turn(0.7548776662466927),
              value = 0.95F - 0.35F * turn(0.5698402909980532);
  glm::vec3 colour;
  for (int c = 0; c < 3; ++c) {
    const float away = std::fmod(hue + static_cast<float>(5 - 2 * c), 6.0F);
    colour[c] = value * (1 - saturation * std::clamp(std::min(away, 4 - away), 0.0F, 1.0F));
  }
  return stored_as(colour);
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
  if (extras.surfaces) {
    depth_.resize(pixels, std::numeric_limits<float>::infinity());
    for (auto* layer : {&position_, &normal_}) layer->resize(pixels, glm::vec3(0));
  }
  if (extras.ids) {
    for (auto* layer : {&object_id_, &material_id_}) layer->resize(pixels, 0);
  }
  for (const std::string& name : extras.shadows)
    shadows_.emplace_back(name, std::vector<float>(pixels));
}

std::uint64_t Film::pixel_bytes(const FilmExtras& extras) noexcept {
  return 5 * sizeof(glm::vec3) + (extras.estimates ? 4 : 2) * sizeof(float) +
         (extras.glossy ? sizeof(glm::vec3) + sizeof(float) : 0) +
         (extras.irradiance ? sizeof(glm::vec3) : 0) +
         (extras.surfaces ? sizeof(float) + 2 * sizeof(glm::vec3) : 0) +
         (extras.ids ? 2 * sizeof(float) : 0) + extras.shadows.size() * sizeof(float);
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

void Film::add(std::size_t pixel, const SurfaceSample& surface) {
  constexpr float kNearer = 1 - 1e-6F;  // a rounding does not choose between equal depths
  if (!(surface.depth < kNearer * depth_[pixel])) return;
  depth_[pixel] = surface.depth;
  position_[pixel] = surface.position;
  normal_[pixel] = surface.normal;
}

void Film::set_ids(std::size_t pixel, const SurfaceId& id) {
  object_id_[pixel] = static_cast<float>(id.object);
  material_id_[pixel] = static_cast<float>(id.material);
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
  const auto take = [at](auto& to, const auto& from) {
    if (!from.empty()) std::ranges::copy(from, to.begin() + at);
  };
  take(bent_normal_, group.bent_normal_);
  take(albedo_, group.albedo_);
  take(occlusion_, group.occlusion_);
  take(alpha_, group.alpha_);
  take(depth_, group.depth_);
  take(position_, group.position_);
  take(normal_, group.normal_);
  take(object_id_, group.object_id_);
  take(material_id_, group.material_id_);
  auto own =
      std::ranges::find(groups_, layer, &std::pair<std::string, std::vector<glm::vec3>>::first);
  if (own == groups_.end())
    own = groups_.insert(own, {layer, std::vector<glm::vec3>(beauty_.size(), glm::vec3(0))});
  take(own->second, group.beauty_);
}

void Film::finish() {
  std::ranges::replace(depth_, std::numeric_limits<float>::infinity(), kNoDepth);
  for (auto* layer : {&occlusion_error_, &irradiance_error_}) {
    for (float& value : *layer) value = std::sqrt(value);
  }
}

std::vector<Film::Layer> Film::layers() const {
  using Kind = ExrLayerType::Kind;
  // Nuke and Blender read R G B A as the picture and Z as its depth, NAME.R and NAME.X as those of
  // a layer, and any other channel of a layer, such as NAME.V, by itself
  std::vector<Layer> layers{{{"", Kind::colour, false}, flat(beauty_)},
                            {{"direct", Kind::colour, false}, flat(direct_)},
                            {{"indirect", Kind::colour, false}, flat(indirect_)},
                            {{"albedo", Kind::colour, false}, flat(albedo_)},
                            {{"occlusion", Kind::scalar, false}, occlusion_},
                            {{"A", Kind::channel, false}, alpha_},
                            {{"bent_normal", Kind::vector, true}, flat(bent_normal_)}};
  if (!depth_.empty()) {
    layers.push_back({{"Z", Kind::channel, true}, depth_});
    layers.push_back({{"P", Kind::vector, true}, flat(position_)});
    layers.push_back({{"N", Kind::vector, false}, flat(normal_)});
  }
  if (!object_id_.empty()) {
    layers.push_back({{"object_id", Kind::scalar, true}, object_id_});
    layers.push_back({{"material_id", Kind::scalar, true}, material_id_});
  }
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
  const auto show = [&](const auto& values, const auto& shown_as) {
    pixels.reserve(count);
    for (const auto& value : std::span(values).subspan(first, count))
      pixels.emplace_back(shown_as(value));
    return pixels;
  };
  if (layer == "occlusion") return show(occlusion_, [](float value) { return 1 - value; });
  if (layer == "depth") return show(depth_, [](float value) { return value; });
  if (layer == "normal") return show(normal_, colour_of_normal);
  if (layer == "object_id") return show(object_id_, colour_of_id);
  if (layer == "material_id") return show(material_id_, colour_of_id);
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
