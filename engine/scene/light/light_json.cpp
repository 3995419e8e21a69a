// The light rig as JSON, and the picture it names.
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/scene/json_fields.h"
#include "engine/scene/light/lights.h"

namespace ptc {
namespace {

constexpr double kMost = std::numeric_limits<float>::max();
constexpr Range kFinite{-kMost, kMost};
constexpr Range kFiniteWide{-std::numeric_limits<double>::max(),
                            std::numeric_limits<double>::max()};
constexpr Range kLight{0, kMost};
constexpr Range kAngle{0, 1.5707964};

// A null in the text would be a number lost; better to say so when it is written.
void require_finite(const Json& json) {
  for (const Json& value : json) {
    if (value.is_structured()) require_finite(value);
    if (value.is_number_float() && !std::isfinite(value.get<double>())) {
      throw std::invalid_argument("light rig: a number is not finite");
    }
  }
}

void make_unit(glm::vec3& direction, const char* name, const JsonFields& fields) {
  const glm::dvec3 wide(direction);
  const double length = glm::length(wide);
  if (length == 0) fields.fail(std::string(name) + " must not be zero");
  // What is unit but for rounding stays as it is, so that a rig survives the round trip.
  if (std::abs(length - 1) > 1e-5) direction = glm::vec3(wide / length);
}

Sun read_sun(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  Sun sun;
  fields.read("to_sun", sun.to_sun, kFinite);
  fields.read("irradiance", sun.irradiance, kLight);
  fields.read("angular_radius", sun.angular_radius, kAngle);
  fields.finish();
  make_unit(sun.to_sun, "to_sun", fields);
  return sun;
}

PointLight read_point(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  PointLight point;
  fields.read("position", point.position, kFiniteWide);
  fields.read("intensity", point.intensity, kLight);
  fields.finish();
  return point;
}

Sky read_sky(const Json& json, const std::string& where) {
  JsonFields fields(json, where);
  Sky sky;
  fields.read("radiance", sky.radiance, kLight);
  fields.read("map", sky.map_path);
  fields.read("up", sky.up, kFinite);
  fields.finish();
  make_unit(sky.up, "up", fields);
  return sky;
}

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
  Json suns = Json::array();
  for (const Sun& sun : rig.suns) {
    suns.push_back({{"to_sun", to_json_array(sun.to_sun)},
                    {"irradiance", to_json_array(sun.irradiance)},
                    {"angular_radius", sun.angular_radius}});
  }
  Json points = Json::array();
  for (const PointLight& point : rig.points) {
    points.push_back({{"position", to_json_array(point.position)},
                      {"intensity", to_json_array(point.intensity)}});
  }
  Json sky{{"radiance", to_json_array(rig.sky.radiance)}, {"up", to_json_array(rig.sky.up)}};
  if (!rig.sky.map_path.empty()) sky["map"] = rig.sky.map_path;
  const Json json{{"suns", suns}, {"points", points}, {"sky", sky}};
  require_finite(json);
  return dump_json(json, "light rig");
}

LightRig light_rig_from_json(const std::string& text) {
  const Json json = parse_json(text, "light rig");
  JsonFields fields(json, "light rig");
  LightRig rig;
  read_list(fields, "suns", rig.suns, read_sun);
  read_list(fields, "points", rig.points, read_point);
  if (const Json* sky = fields.find("sky")) rig.sky = read_sky(*sky, "light rig: sky");
  fields.finish();
  return rig;
}

void load_sky_map(Sky& sky, const std::filesystem::path& directory) {
  if (sky.map_path.empty()) return;
  sky.map = std::make_shared<const Image>(read_image(directory / sky.map_path));
}

}  // namespace ptc
