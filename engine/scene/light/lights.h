// Lights, and their JSON record.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/image/texture.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Returns the sum of the channels of a colour; what is negative or not finite counts as black.
[[nodiscard]] inline double brightness(const glm::vec3& c) noexcept {
  const double sum = static_cast<double>(c.x) + static_cast<double>(c.y) + static_cast<double>(c.z);
  return sum > 0 && std::isfinite(sum) ? sum : 0;
}

/// A disc of light infinitely far away.
struct Sun {
  glm::vec3 to_sun{0, 1, 0};        ///< unit, from the scene towards the middle of the sun
  glm::vec3 irradiance{3};          ///< on a surface that faces the sun, W/m^2
  float angular_radius = 0.00465f;  ///< radians, at most pi / 2; 0 gives sharp shadows
  std::string group;                ///< of LightRig
};

/// Returns the unit direction towards a sun.
///
///     up    azimuth 0     azimuth 90
///     +y    +z            +x
///     +z    +y, north     +x, east: as a compass has it
///     +x    +y            +z
///
/// @param up  the axis that points up: elevation 90
[[nodiscard]] glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees,
                                      const glm::vec3& up = {0, 1, 0});

/// The maximum coordinate of a point light, scene units. Its square is still a finite double.
inline constexpr double kMaxLightDistance = 1e150;

/// A lamp without extent that shines the same in all directions.
struct PointLight {
  glm::dvec3 position{0};  ///< scene units, each coordinate at most kMaxLightDistance
  glm::vec3 intensity{1};  ///< W/sr
  std::string group;       ///< of LightRig
};

/// A lamp without extent that shines into a cone (spec/shading.md#spots).
struct SpotLight {
  glm::dvec3 position{0};          ///< scene units, each coordinate at most kMaxLightDistance
  glm::vec3 direction{0, -1, 0};   ///< unit, from the lamp along the axis of the cone
  glm::vec3 intensity{1};          ///< within the inner cone, W/sr
  float inner_angle = 0;           ///< radians, from the axis; at most `outer_angle`
  float outer_angle = 0.7853982f;  ///< radians, from the axis; above 0, at most pi / 2
  std::string group;               ///< of LightRig
};

/// Returns the share of a spot light's intensity that goes towards a place: 1 within the inner
/// cone, 0 outside the outer cone and at the lamp itself.
/// Source: glTF 2.0, KHR_lights_punctual, "Inner and Outer Cone Angles".
/// @param place  scene units
[[nodiscard]] double spot_share(const SpotLight& spot, const glm::dvec3& place) noexcept;

/// Light that arrives from infinitely far away, from all directions: a constant, or a
/// latitude-longitude map.
///
/// The map is laid as OpenEXR's ENVMAP_LATLONG: with +y up, the middle column looks along +z, and
/// seen from inside, the columns to the right of it turn to -x; rows go from the zenith (the upper
/// border) to the nadir, evenly in angle.
///
///     column   0      1/4     1/2     3/4     1  of the width
///     looks   -z      +x      +z      -x     -z
///
/// Another `up` turns the map by the smallest rotation that takes +y to it (by half a turn about x
/// for -y). Between pixel centres the radiance is bilinear, also across the map's left and right
/// border.
struct Sky {
  glm::vec3 radiance{0};               ///< W/(m^2 sr); multiplies the map where there is one
  std::shared_ptr<const Texture> map;  ///< null: `radiance` arrives from every direction
  /// The file of the map. A container records it as an absolute path, so that programs find the map
  /// again.
  std::string map_path;
  std::uint64_t map_xxh3 = 0;  ///< image_xxh3() of the map when it was recorded; 0: unknown
  glm::vec3 up{0, 1, 0};       ///< unit; the direction of the map's upper border
  std::string group;           ///< of LightRig

  /// Returns the radiance that arrives from a direction, W/(m^2 sr).
  /// @param direction  unit, away from the surface
  [[nodiscard]] glm::vec3 at(const glm::vec3& direction) const;
};

/// Returns Sky::at() of a copy of the sky as a function, which is what a gather takes. The function
/// is empty when the sky is black.
[[nodiscard]] std::function<glm::vec3(const glm::vec3&)> sky_function(const Sky& sky);

/// All lights of a scene except its area lights, which are the emissive triangles of its mesh.
///
/// Lights may be in groups, whose light is kept apart (spec/shading.md#light-groups): each names
/// its own, and an empty name stands for the group of the rest.
struct LightRig {
  std::vector<Sun> suns;           ///< any number
  std::vector<PointLight> points;  ///< any number
  std::vector<SpotLight> spots;    ///< any number
  Sky sky;
};

/// Says whether a sun, a point light or a spot light shines.
[[nodiscard]] bool has_lamps(const LightRig& rig);

/// The name that the group of the rest has in channels and layers.
inline constexpr const char* kRestGroup = "rest";

/// Says whether a text can name a group: 1 to 25 letters from a to z, digits and underscores, but
/// not the name of the rest.
[[nodiscard]] bool is_group_name(std::string_view text) noexcept;

/// Returns the groups of the lights that shine, in the order of their first lights; the empty name
/// of the rest is last.
/// @param emitters  whether surfaces emit, which belongs to the rest
[[nodiscard]] std::vector<std::string> light_groups(const LightRig& rig, bool emitters);

/// Returns the rig with the lights of all other groups switched off. They keep their places, so
/// that each light takes the same sample points with others and without.
[[nodiscard]] LightRig only_group(LightRig rig, const std::string& group);

/// Checks the numbers of a sky.
/// @param field  the member of the request that holds the sky, for the error
/// @throws RequestError when `up` has no direction, the radiance is negative or not finite, or the
///         map has another number of pixels than its size says
void check_sky(const Sky& sky, const char* field);
/// Checks the numbers of all lights; the error names the member `lights`.
/// @throws RequestError when a direction is zero, or a number is negative, not finite or out of
///         range
void check_lights(const LightRig& rig);

/// Returns the lights for a scene that brings none of its own: a sun and a bluish sky.
/// @param up  the axis that points up
[[nodiscard]] LightRig default_rig(const glm::vec3& up = {0, 1, 0});

/// Lumens that count as 1 W: the luminous efficacy of light of 555 nm, which glTF's exporters take
/// for all light.
inline constexpr double kLumensPerWatt = 683;

/// Returns the lights of mesh files, without a sky.
[[nodiscard]] LightRig rig_of(std::span<const MeshLight> lights);

/// Returns the lights of a cloud that gives no light of its own: a white sky, under which a surface
/// that nothing covers has the colour of its albedo.
/// @param up  unit; the direction that points upwards in the cloud
[[nodiscard]] LightRig cloud_rig(const glm::vec3& up);

/// Returns the JSON text of a rig for the record in a container. The map of the sky is named by its
/// path:
/// {"suns": [{"to_sun": [x, y, z], "irradiance": [r, g, b], "angular_radius": a}, ...],
///  "points": [{"position": [x, y, z], "intensity": [r, g, b]}, ...],
///  "spots": [{"position": [x, y, z], "direction": [x, y, z], "intensity": [r, g, b],
///             "inner_angle": a, "outer_angle": a}, ...],
///  "sky": {"radiance": [r, g, b], "map": "path", "map_xxh3": "16 hex digits", "up": [x, y, z]}}
/// A light of a group has a member "group" with its name.
/// A rig without spot lights has no member "spots", so that versions of PTCX that do not know them
/// read it. A sky with a map gets the digest of that map, not Sky::map_xxh3.
/// @throws RequestError when a number is not finite or the path is not UTF-8
[[nodiscard]] std::string to_json(const LightRig& rig);
/// Parses the JSON text of a rig. It is the exact inverse of to_json(), except that Sky::map stays
/// null until load_sky_map() reads the picture. Members that are absent keep their defaults, and
/// directions that are not unit are normalised.
/// @throws DataError when the text is not JSON, or a member is unknown, has the wrong type or is
///         out of range
[[nodiscard]] LightRig light_rig_from_json(const std::string& text);

/// Returns the XXH3 of the size and the pixels of an image; never 0.
[[nodiscard]] std::uint64_t image_xxh3(const Texture& image);

/// The state of the map of a recorded sky, as load_sky_map() found it.
enum class SkyMap {
  none,     ///< the sky has no map
  same,     ///< the map is the one that was recorded, or the record has no digest to compare with
  changed,  ///< the file was found, and its picture differs from the recorded one
};

/// Reads the picture that `sky.map_path` names, if any. Where that file does not exist, a file of
/// the same name in `directory` takes its place.
/// @param directory  the directory of the container that holds the record
/// @param store      into which the picture is read
/// @throws DataError when neither file exists; as TextureStore::read()
SkyMap load_sky_map(Sky& sky, const std::filesystem::path& directory, TextureStore& store);

/// Numbers of shadow rays for one surface point; 0 leaves the lights of that kind out.
struct LightSampling {
  static constexpr unsigned kMost = 1U << 16;  ///< that programs take, of each

  unsigned sun_rays = 4;    ///< for each sun; a sun of angular radius 0 takes 1 in any case
  unsigned area_rays = 16;  ///< over all emissive triangles, by what each may give to the point
  unsigned sky_rays = 64;   ///< cosine-distributed; with a map, half of them by its brightness
};

}  // namespace ptc
