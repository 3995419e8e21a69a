#include "engine/pipeline/render/picture_layers.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include "engine/base/error.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/shade/shading_channels.h"

namespace ptc {
namespace {

bool is_id(std::string_view layer) {
  return layer == "object_id" || layer == "material_id";
}

/// Says whether a target has one of some layers: an .exr has them all.
bool has_one_of(std::span<const PictureTarget> targets,
                std::initializer_list<std::string_view> layers) {
  return std::ranges::any_of(targets, [&](const PictureTarget& target) {
    return lower_extension(target.path) == ".exr" ||
           std::ranges::find(layers, target.layer) != layers.end();
  });
}

}  // namespace

bool has_ids(const RenderRequest& request, std::span<const PictureTarget> targets) {
  return !request.vertices && has_one_of(targets, {"object_id", "material_id"});
}

void require_ids(std::span<const PictureTarget> targets, bool sees_mesh) {
  if (sees_mesh || std::ranges::none_of(targets, is_id, &PictureTarget::layer)) return;
  throw RequestError("targets",
                     "surfels do not know their objects and materials: the layers 'object_id' and "
                     "'material_id' need a mesh that the camera sees");
}

FilmExtras extras_of(const RenderRequest& request, std::span<const PictureTarget> targets,
                     bool ids) {
  FilmExtras extras{.estimates = request.estimate,
                    .glossy = request.glossy.roughness.has_value(),
                    .irradiance = request.bakes(),
                    .surfaces = !request.bakes() && has_one_of(targets, {"depth", "normal"}),
                    .ids = ids};
  for (const std::string& group : request.shadows) extras.shadows.push_back(shadow_channel(group));
  return extras;
}

std::vector<ExrLayerType> layer_types(const Film& film) {
  std::vector<ExrLayerType> types;
  for (const Film::Layer& layer : film.layers()) types.push_back(layer.type);
  return types;
}

}  // namespace ptc
