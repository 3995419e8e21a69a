// Suns, point lights, skies and cameras from the command line.
//
//   --sun 30,60,4          azimuth from +z to +x, elevation above the horizon, irradiance
//   --point 0,3,0,9,9,9    position, intensity
//   --sky 0.5,0.6,0.8      radiance; one number is grey, any other text names a picture
//   --camera 0,1,4,0,1,0   position, target
//
// An option's text is checked as soon as it is parsed, so that a wrong one is a usage error. The
// picture of a sky is read later, by sky(): a wrong picture is invalid data.
#include "tools/scene_options.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>

#include <glm/trigonometric.hpp>

#include "engine/io/image/image.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "tools/common.h"
#include "tools/values.h"

namespace ptc {
namespace {

/// Three numbers, or one for grey, from 0 to 1e30.
glm::vec3 parse_colour(const std::string& option, const std::string& text) {
  constexpr char kExpected[] = "R,G,B or one number for grey, from 0 up";
  const std::vector<double> n = parse_numbers(option, text, {1, 3}, kExpected);
  const glm::vec3 colour =
      n.size() == 1 ? glm::vec3(glm::dvec3(n[0])) : glm::vec3(n[0], n[1], n[2]);
  for (int c = 0; c < 3; ++c) {
    if (!(colour[c] >= 0 && colour[c] <= 1e30F)) refuse(option, text, kExpected);
  }
  return colour;
}

/// Declares an option that takes one value each time that it is given.
CLI::Option* add_repeated(CLI::App& app, const std::string& name,
                          const std::function<void(const std::vector<std::string>&)>& set,
                          const std::string& description) {
  return app.add_option_function<std::vector<std::string>>(name, set, description)
      ->allow_extra_args(false);
}

using Texts = std::map<std::string, std::string>;

/// Returns the texts of the first cloud that says which axis is up; none where no one does.
Texts text_with_up(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& file : files) {
    if (!holds_points(file)) continue;
    Texts text = open_point_input(file).info.text;
    if (text.contains(kUpKey)) return text;
  }
  return {};
}

}  // namespace

void LightArguments::declare(CLI::App& app) {
  constexpr char kGroup[] = "Lights";
  add_repeated(
      app, "--sun", [this](const std::vector<std::string>& v) { set_suns(v); },
      "Sun: azimuth and elevation in degrees, irradiance [3]; repeatable\n"
      "The elevation is above the horizon, the plane of x and z; +y is up. The azimuth turns from "
      "+z to +x. The irradiance is that of a surface that faces the sun, in "
      "W/m^2.")
      ->type_name("AZ,EL[,E]")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--sun-colour",
         [this](const std::string& t) { sun_colour_ = parse_colour("--sun-colour", t); },
         "Colour of all suns, a factor on their irradiance")
      ->type_name("R,G,B")
      ->default_str("1,1,1")
      ->needs("--sun")
      ->group(kGroup);
  add_number(app, "--sun-size", sun_degrees_, 0, 90, "Angular diameter of the suns, in degrees")
      ->type_name("DEGREES")
      ->needs("--sun")
      ->group(kGroup);
  add_repeated(
      app, "--point", [this](const std::vector<std::string>& v) { set_points(v); },
      "Point light: position and intensity in W/sr; repeatable")
      ->type_name("X,Y,Z,R,G,B")
      ->group(kGroup);
  declare_sky(app);
}

void LightArguments::declare_sky(CLI::App& app) {
  const auto set = [this](const std::string& text) {
    sky_ = text;
    sky_radiance_.reset();
    // A text of these letters is a number: a picture that has such a name is given as ./1.exr.
    if (text.find_first_not_of("0123456789.,+-eE") == std::string::npos) {
      sky_radiance_ = parse_colour("--sky", text);
    }
  };
  app.add_option_function<std::string>(
         "--sky", set,
         "Sky: colour, grey level or latitude-longitude picture, in W/m^2/sr\n"
         "+y is up: it is the upper edge of the picture.")
      ->type_name("R,G,B|L|FILE")
      ->group("Lights");
  add_number(app, "--sky-scale", sky_scale_, 0, 1e6, "Factor on the radiance of the sky")
      ->type_name("FACTOR")
      ->needs("--sky")
      ->group("Lights");
}

void LightArguments::set_suns(const std::vector<std::string>& values) {
  constexpr char kExpected[] =
      "AZ,EL[,E] with an elevation from -90 to 90 and an irradiance from 0 up";
  suns_.clear();
  for (const std::string& text : values) {
    const std::vector<double> n = parse_numbers("--sun", text, {2, 3}, kExpected);
    const double strength = n.size() == 3 ? n[2] : 3;
    if (std::abs(n[1]) > 90 || !(strength >= 0 && strength <= 1e30))
      refuse("--sun", text, kExpected);
    suns_.push_back({.to_sun = sun_direction(n[0], n[1]),
                     .irradiance = glm::vec3(static_cast<float>(strength))});
  }
}

void LightArguments::set_points(const std::vector<std::string>& values) {
  constexpr char kExpected[] = "X,Y,Z,R,G,B with a position and an intensity from 0 up";
  points_.clear();
  for (const std::string& text : values) {
    const std::vector<double> n = parse_numbers("--point", text, {6}, kExpected);
    for (std::size_t c = 3; c < 6; ++c) {
      if (!(n[c] >= 0 && n[c] <= 1e30)) refuse("--point", text, kExpected);
    }
    points_.push_back({.position = {n[0], n[1], n[2]}, .intensity = {n[3], n[4], n[5]}});
  }
}

bool LightArguments::given() const noexcept {
  return !suns_.empty() || !points_.empty() || sky_given();
}

LightRig LightArguments::rig() const {
  LightRig rig{.suns = suns_, .points = points_, .sky = sky()};
  for (Sun& sun : rig.suns) {
    sun.irradiance *= sun_colour_;
    sun.angular_radius = static_cast<float>(glm::radians(sun_degrees_ / 2));
  }
  return rig;
}

Sky LightArguments::sky() const {
  Sky sky;
  if (sky_.empty()) return sky;
  sky.radiance = sky_radiance_.value_or(glm::vec3(1)) * sky_scale_;
  if (sky_radiance_) return sky;
  check_input(sky_);
  sky.map_path = sky_;
  sky.map = std::make_shared<const Image>(read_image(sky_));
  return sky;
}

glm::vec3 up_of_files(const std::vector<std::filesystem::path>& files, const std::string& axis) {
  return up_of(axis.empty() ? text_with_up(files) : Texts{{kUpKey, axis}});
}

void note_unknown_up(const std::vector<std::filesystem::path>& files, const std::string& axis,
                     Progress& progress) {
  if (!axis.empty()) return;
  const auto silent = std::ranges::find_if(
      files, [](const auto& file) { return holds_points(file) && !is_container(file); });
  if (silent == files.end() || !text_with_up(files).empty()) return;
  progress.note(silent->filename().string() +
                ": the file does not say which axis is up, y is taken; --up z if it is z");
}

void add_light_sampling(CLI::App& app, LightSampling& sampling) {
  constexpr std::uint64_t kMax = 1 << 16;
  add_integer(app, "--sun-rays", sampling.sun_rays, 1, kMax,
              "Shadow rays from each point to each sun")
      ->group(kExpertGroup);
  add_integer(app, "--sky-rays", sampling.sky_rays, 0, kMax,
              "Shadow rays from each point to the sky")
      ->group(kExpertGroup);
  add_integer(app, "--area-rays", sampling.area_rays, 0, kMax,
              "Shadow rays from each point to emissive triangles")
      ->group(kExpertGroup);
}

void CameraArguments::declare(CLI::App& app, const std::string& purpose) {
  app.add_option_function<std::string>(
         "--camera", [this](const std::string& text) { set_place(text); }, purpose)
      ->type_name("X,Y,Z,X,Y,Z")
      ->group("Camera");
  app.add_option_function<double>(
         "--fov",
         [this](const double& degrees) {
           camera_.vertical_fov = static_cast<float>(glm::radians(degrees));
         },
         "Vertical field of view of --camera, in degrees")
      ->type_name("DEGREES")
      ->default_str("40.1")
      ->check(in_range(0.01, 179))
      ->needs("--camera")
      ->group("Camera");
  app.add_option_function<std::string>(
         "--size", [this](const std::string& text) { set_size(text); },
         "Width and height of the picture, in pixels")
      ->type_name("WxH")
      ->default_str(std::to_string(camera_.width) + "x" + std::to_string(camera_.height))
      ->group("Camera");
}

void CameraArguments::set_place(const std::string& text) {
  constexpr char kExpected[] = "X,Y,Z,X,Y,Z with a position and another place as target";
  const std::vector<double> n = parse_numbers("--camera", text, {6}, kExpected);
  camera_.position = {n[0], n[1], n[2]};
  camera_.look_at = {n[3], n[4], n[5]};
  if (camera_.position == camera_.look_at) refuse("--camera", text, kExpected);
  given_ = true;
}

void CameraArguments::set_size(const std::string& text) {
  constexpr unsigned kMax = 1 << 16;  // of a side of an EXR
  const std::size_t cross = text.find('x');
  const auto side = [&](std::string_view digits) {
    const auto pixels = parse_number<unsigned>(digits);
    if (!pixels || *pixels < 1 || *pixels > kMax) {
      refuse("--size", text, "WIDTHxHEIGHT, 1 to 65536 each");
    }
    return *pixels;
  };
  if (cross == std::string::npos) refuse("--size", text, "WIDTHxHEIGHT, such as 960x540");
  const std::string_view whole = text;
  size_ = {side(whole.substr(0, cross)), side(whole.substr(cross + 1))};
}

std::optional<Camera> CameraArguments::camera() const {
  if (!given_) return {};
  Camera camera = camera_;
  if (size_) {
    camera.width = (*size_)[0];
    camera.height = (*size_)[1];
  }
  return camera;
}

}  // namespace ptc
