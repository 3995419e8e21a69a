#include "engine/pipeline/build/build_record.h"

#include <span>

#include <fmt/format.h>

#include "engine/io/file/url.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/scene_record.h"
#include "format/text.h"

namespace ptc {
namespace {

/// Cuts a list of names to what a quarter of a page holds.
std::string shortened(const std::string& names, std::uint8_t page_shift) {
  const std::size_t most = std::size_t{1} << page_shift >> 2;
  if (names.size() <= most) return names;
  const std::size_t end = names.rfind(' ', most);
  return end == std::string::npos ? std::string("...") : names.substr(0, end) + " ...";
}

}  // namespace

Meta make_meta(const BuildRequest& request, const BuildInputs& inputs) {
  Meta meta{.channels = inputs.attributes.channels(), .text = inputs.clouds.text};
  std::string names = request.input_names;
  for (const auto& input : request.inputs) {
    if (!request.input_names.empty()) break;
    if (!names.empty()) names += ' ';
    names += printable(file_name(input));
  }
  if (request.city_points > 0) names = "city " + std::to_string(request.city_points);
  meta.text[kInputsKey] = names;
  meta.text[kLightsKey] = lights_record(inputs.lights);
  if (inputs.rays_at_emitters) meta.text[kEmittersKey] = "baked";
  if (inputs.clouds.unlit && !inputs.has_meshes()) meta.text[kSkyLightKey] = "gathered";
  const bool assumed = inputs.clouds.points > 0 && !inputs.clouds.coloured && !inputs.has_meshes();
  if (assumed) meta.text[kAlbedoKey] = kAssumed;
  if (is_rounded(request.profile)) meta.text[kRoundingKey] = rounding_text();
  if (request.sampling.camera) meta.text[kCameraKey] = to_json(*request.sampling.camera);
  return meta;
}

Meta complete_record(Meta meta, double spacing, const Meta* scene, std::uint8_t page_shift) {
  if (spacing > 0) meta.text[kSpacingKey] = fmt::format("{}", spacing);
  if (scene) meta = extended_meta(*scene, meta);
  std::string& names = meta.text[kInputsKey];
  names = shortened(names, page_shift);
  return meta;
}

Uuid content_uuid(const RecordsDigest& points, std::span<const RecordsDigest> attributes,
                  const Frame& frame, const BuildRequest& request, const Meta& meta,
                  const Uuid& scene) {
  std::string text = fmt::format("{:x} {:x} {} {} {} {} {} {} {} {}", points[0], points[1],
                                 frame.origin[0], frame.origin[1], frame.origin[2], frame.edge,
                                 request.tree.leaf_points, request.tree.levels_per_stream,
                                 request.page_shift, static_cast<int>(request.profile));
  for (const auto& [key, value] : meta.text)
    text.append("\n").append(key).append("=").append(value);
  for (const Channel& c : meta.channels) {
    text += fmt::format("\n{} {} {} {} {} {} {} {} {} {}", c.name, static_cast<int>(c.type),
                        c.components, c.group, static_cast<int>(c.role),
                        static_cast<int>(c.colour_space), c.unit, c.no_value.value_or(0), c.scale,
                        c.offset);
  }
  for (const RecordsDigest& group : attributes)
    text += fmt::format(" {:x} {:x}", group[0], group[1]);
  if (scene != Uuid{})
    text.append("\n").append(reinterpret_cast<const char*>(scene.data()), scene.size());
  return uuid_of(std::as_bytes(std::span(text)));
}

}  // namespace ptc
