// The JSON record of a light rig, and the picture that it names.
//
// A container records the rig that lit its points, so that a later run can light the same scene the
// same way. The record holds the path and the digest of the sky's picture, not the picture itself:
//
//     to_json()              rig, picture in memory   ->  text with path and digest
//     light_rig_from_json()  text                     ->  rig with path and digest, no picture
//     load_sky_map()         that rig                 ->  picture read, its digest compared
//
// light_rig_from_json(to_json(rig)) is exact: numbers keep all their digits, and directions that
// are unit within rounding stay as they are.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/url.h"
#include "engine/scene/json_fields.h"
#include "engine/scene/light/lights.h"
#include "format/checksum.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr double kMostFloat = std::numeric_limits<float>::max();
constexpr Range kFinite{-kMostFloat, kMostFloat};
constexpr Range kPlace{-kMaxLightDistance, kMaxLightDistance};
constexpr Range kLight{0, kMostFloat};
constexpr Range kAngle{0, 1.5707964};

// Checks that every number can be written. JSON has null in place of numbers that are not finite,
// so such a number would be lost without a word.
void require_finite(const Json& json) {
  for (const Json& value : json) {
    if (value.is_structured()) require_finite(value);
    if (value.is_number_float() && !std::isfinite(value.get<double>())) {
      throw RequestError("lights", "a number of the lights is not finite");
    }
  }
}

// Normalises a direction that was read. @throws DataError when it is zero
void make_unit(glm::vec3& direction, const char* name, const JsonFields& fields) {
  const glm::dvec3 wide(direction);
  const double length = glm::length(wide);
  if (length == 0) fields.fail(std::string(name) + " must not be zero");
  // Keep what is unit but for rounding, so that a rig survives the round trip.
  if (std::abs(length - 1) > 1e-5) direction = glm::vec3(wide / length);
}

// Reads the name of a light's group. @throws DataError when it is none
void read_group(JsonFields& fields, std::string& group) {
  fields.read("group", group);
  if (!group.empty() && !is_group_name(group)) fields.fail("group is not the name of a group");
}

// Adds the name of a light's group, if it has one.
Json with_group(Json light, const std::string& group) {
  if (!group.empty()) light["group"] = group;
  return light;
}

Sun read_sun(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  Sun sun;
  fields.read("to_sun", sun.to_sun, kFinite);
  fields.read("irradiance", sun.irradiance, kLight);
  fields.read("angular_radius", sun.angular_radius, kAngle);
  read_group(fields, sun.group);
  fields.finish();
  make_unit(sun.to_sun, "to_sun", fields);
  return sun;
}

PointLight read_point(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  PointLight point;
  fields.read("position", point.position, kPlace);
  fields.read("intensity", point.intensity, kLight);
  read_group(fields, point.group);
  fields.finish();
  return point;
}

SpotLight read_spot(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  SpotLight spot;
  fields.read("position", spot.position, kPlace);
  fields.read("direction", spot.direction, kFinite);
  fields.read("intensity", spot.intensity, kLight);
  fields.read("inner_angle", spot.inner_angle, kAngle);
  fields.read("outer_angle", spot.outer_angle, kAngle);
  read_group(fields, spot.group);
  fields.finish();
  make_unit(spot.direction, "direction", fields);
  if (spot.outer_angle == 0) fields.fail("outer_angle must be above 0");
  if (spot.inner_angle > spot.outer_angle) fields.fail("inner_angle must not be above outer_angle");
  return spot;
}

std::uint64_t parse_digest(const std::string& text, const JsonFields& fields) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (error != std::errc() || end != text.data() + text.size() || text.size() != 16) {
    fields.fail("map_xxh3 must be 16 hexadecimal digits");
  }
  return value;
}

std::string digest_text(std::uint64_t digest) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (int shift = 60; shift >= 0; shift -= 4) text += kDigits[digest >> shift & 15];
  return text;
}

Sky read_sky(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  Sky sky;
  fields.read("radiance", sky.radiance, kLight);
  fields.read("map", sky.map_path);
  std::string digest;
  fields.read("map_xxh3", digest);
  if (!digest.empty()) sky.map_xxh3 = parse_digest(digest, fields);
  fields.read("up", sky.up, kFinite);
  read_group(fields, sky.group);
  fields.finish();
  make_unit(sky.up, "up", fields);
  return sky;
}

// Reads an array of lights by `read`, which also takes the element's name for messages.
template <typename Light, typename Read>
void read_list(JsonFields& fields, const char* name, std::vector<Light>& lights, Read read) {
  const Json* list = fields.find(name);
  if (list == nullptr) return;
  if (!list->is_array()) fields.fail(std::string(name) + " must be an array");
  for (const Json& light : *list) {
    lights.push_back(
        read(light, "light rig: " + std::string(name) + "[" + std::to_string(lights.size()) + "]"));
  }
}

}  // namespace

std::string to_json(const LightRig& rig) {
  // Write the suns, the point lights and the spot lights.
  Json suns = Json::array();
  for (const Sun& sun : rig.suns) {
    suns.push_back(with_group({{"to_sun", to_json_array(sun.to_sun)},
                               {"irradiance", to_json_array(sun.irradiance)},
                               {"angular_radius", sun.angular_radius}},
                              sun.group));
  }
  Json points = Json::array();
  for (const PointLight& point : rig.points) {
    points.push_back(with_group({{"position", to_json_array(point.position)},
                                 {"intensity", to_json_array(point.intensity)}},
                                point.group));
  }
  Json spots = Json::array();
  for (const SpotLight& spot : rig.spots) {
    spots.push_back(with_group({{"position", to_json_array(spot.position)},
                                {"direction", to_json_array(spot.direction)},
                                {"intensity", to_json_array(spot.intensity)},
                                {"inner_angle", spot.inner_angle},
                                {"outer_angle", spot.outer_angle}},
                               spot.group));
  }
  // Write the sky, its map by path and digest.
  Json sky =
      with_group({{"radiance", to_json_array(rig.sky.radiance)}, {"up", to_json_array(rig.sky.up)}},
                 rig.sky.group);
  if (!is_utf8(rig.sky.map_path)) {
    throw RequestError("lights",
                       "the name of the sky's picture is not UTF-8, so the lights cannot be "
                       "recorded: rename the picture");
  }
  if (!rig.sky.map_path.empty()) {
    sky["map"] = rig.sky.map_path;
    const std::uint64_t digest = rig.sky.map ? image_xxh3(*rig.sky.map) : rig.sky.map_xxh3;
    if (digest != 0) sky["map_xxh3"] = digest_text(digest);
  }
  Json json{{"suns", suns}, {"points", points}, {"sky", sky}};
  if (!spots.empty()) json["spots"] = spots;
  require_finite(json);
  return dump_json(json, "light rig");
}

LightRig light_rig_from_json(const std::string& text) {
  const Json json = parse_json(text, "light rig");
  JsonFields fields(json, "light rig");
  LightRig rig;
  read_list(fields, "suns", rig.suns, read_sun);
  read_list(fields, "points", rig.points, read_point);
  read_list(fields, "spots", rig.spots, read_spot);
  if (const Json* sky = fields.find("sky")) rig.sky = read_sky(*sky, "light rig: sky");
  fields.finish();
  return rig;
}

// Seeds the digest with the size, so that pictures of other proportions differ.
std::uint64_t image_xxh3(const Texture& image) {
  Xxh3 digest(std::uint64_t{image.width()} << 32 | image.height());
  image.visit_rows([&digest](std::span<const glm::vec3> row) { digest.add(std::as_bytes(row)); });
  return std::max<std::uint64_t>(1, digest.value());
}

SkyMap load_sky_map(Sky& sky, const std::filesystem::path& directory, TextureStore& store) {
  // Find the file: where it was recorded, else in the given directory.
  if (sky.map_path.empty()) return SkyMap::none;
  const std::filesystem::path recorded(sky.map_path);
  const std::filesystem::path beside = directory / recorded.filename();
  const bool is_there = is_file(recorded);
  if (!is_there && !is_file(beside)) {
    const bool elsewhere =
        is_url(beside) || std::filesystem::absolute(beside).lexically_normal() !=
                              std::filesystem::absolute(recorded).lexically_normal();
    throw DataError("the sky picture " + recorded.string() + " that lit the scene does not exist" +
                    (elsewhere ? ", and neither does " + beside.string() : "") +
                    ": put it there, or give a sky to what shades the scene or lights it anew");
  }
  // Read it, and compare its digest with the recorded one.
  sky.map = std::make_shared<const Texture>(store.read(is_there ? recorded : beside));
  const bool same = sky.map_xxh3 == 0 || sky.map_xxh3 == image_xxh3(*sky.map);
  return same ? SkyMap::same : SkyMap::changed;
}

}  // namespace ptc
