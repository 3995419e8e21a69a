// Lights and what they do to a surface point.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/image/image.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

struct Sun {
  glm::vec3 to_sun{0, 1, 0};        ///< unit
  glm::vec3 irradiance{3};          ///< on a surface that faces it
  float angular_radius = 0.00465f;  ///< radians, at most pi / 2; 0: a sharp shadow
};

/// Towards a sun: azimuth 0 is +z, 90 is +x; elevation 90 is +y.
[[nodiscard]] glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees);

/// Greatest coordinate of a point light, whose square is still a number.
inline constexpr double kMaxLightDistance = 1e150;

struct PointLight {
  glm::dvec3 position{0};  ///< each coordinate at most kMaxLightDistance
  glm::vec3 intensity{1};  ///< W / sr
};

/// Light from infinitely far away: a constant, or a latitude-longitude map.
///
/// The map is laid as OpenEXR's ENVMAP_LATLONG: with +y up, the middle column looks along +z, and
/// seen from inside, the columns to the right of it turn to -x; rows go from the zenith (the upper
/// border) to the nadir, evenly in angle.
///
///     column   0      1/4     1/2     3/4     1  of the width
///     looks   -z      +x      +z      -x     -z
///
/// Another `up` turns the map by the smallest rotation that takes +y to it (by half a turn about x
/// for -y). Between pixel centres the radiance is bilinear, across the seam too.
struct Sky {
  glm::vec3 radiance{0};             ///< multiplies the map
  std::shared_ptr<const Image> map;  ///< none: `radiance` from everywhere
  /// The file of the map. A container records it as an absolute path, so that programs find the map
  /// again.
  std::string map_path;
  std::uint64_t map_xxh3 = 0;  ///< image_xxh3() of the map when it was recorded; 0: not known
  glm::vec3 up{0, 1, 0};       ///< unit

  /// Radiance that arrives from `direction` (unit, away from the surface).
  [[nodiscard]] glm::vec3 at(const glm::vec3& direction) const;
};

/// Sky::at() as a function for a gather; empty when the sky is black.
[[nodiscard]] std::function<glm::vec3(const glm::vec3&)> sky_function(const Sky& sky);

/// All lights of a scene; area lights are the mesh's emissive triangles.
struct LightRig {
  std::vector<Sun> suns;
  std::vector<PointLight> points;
  Sky sky;
};

/// What lights a scene that brings no light of its own: a sun and a bluish sky.
[[nodiscard]] LightRig default_rig();

/// JSON text of a rig (the map by its path), for the container's record:
/// {"suns": [{"to_sun": [x, y, z], "irradiance": [r, g, b], "angular_radius": a}, ...],
///  "points": [{"position": [x, y, z], "intensity": [r, g, b]}, ...],
///  "sky": {"radiance": [r, g, b], "map": "path", "map_xxh3": "16 hex digits", "up": [x, y, z]}}
/// A sky with a map gets the map's own digest, not Sky::map_xxh3.
/// @throws RequestError when a number is not finite or the path is not UTF-8
[[nodiscard]] std::string to_json(const LightRig& rig);
/// The inverse of to_json, exact; members that are absent keep their defaults. The map is named,
/// not read: load_sky_map() reads it. Directions that are not unit are made so.
/// @throws DataError when it is no JSON, a member is unknown or of the wrong type, or out of range
[[nodiscard]] LightRig light_rig_from_json(const std::string& text);

/// XXH3 of the pixels of an image; never 0.
[[nodiscard]] std::uint64_t image_xxh3(const Image& image);

/// What became of the map of a recorded sky.
enum class SkyMap {
  none,     ///< the sky has no map
  same,     ///< the map is the one that was recorded, or the record does not tell
  changed,  ///< the file was found, and its picture differs from the recorded one
};

/// Reads the picture that `sky.map_path` names, if any. Where that file does not exist, a file of
/// the same name in `directory` takes its place.
/// @param directory  that of the container with the record
/// @throws DataError when there is neither, and as read_image(); std::system_error
SkyMap load_sky_map(Sky& sky, const std::filesystem::path& directory);

/// Numbers of shadow rays for one surface point; 0 leaves these lights out.
struct LightSampling {
  unsigned sun_rays = 4;    ///< for each sun; 1 when the sun is a point
  unsigned area_rays = 16;  ///< over all emissive triangles, by what each may give to the point
  unsigned sky_rays = 64;   ///< cosine-distributed; with a map, half of them by its brightness
};

/// Direct irradiance by shadow rays. Deterministic: the seed fixes the sample points.
/// Threads: may be called concurrently.
/// Memory: 60 bytes an emissive triangle, 4 bytes a pixel of the sky map.
class DirectLight {
 public:
  /// @param scene  must outlive this
  /// @throws RequestError when a direction is zero or a number not finite or negative
  DirectLight(const RayScene& scene, LightRig rig);
  ~DirectLight();

  /// Irradiance at a point, split by where it comes from.
  struct Result {
    glm::vec3 local{0};  ///< suns, points, emissive triangles
    glm::vec3 sky{0};
  };
  /// @param position  on the surface: rays begin a few epsilons off it, see step_off()
  /// @param normal    of any length; without a direction there is no light
  /// Unbiased but for the steps off the surface; finite whatever the arguments.
  [[nodiscard]] Result irradiance(const glm::dvec3& position, const glm::vec3& normal,
                                  const LightSampling& sampling, std::uint64_t seed) const;
  [[nodiscard]] const LightRig& rig() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
