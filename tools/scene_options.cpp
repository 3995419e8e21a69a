// Suns, lamps, skies and cameras from the command line.
//
//   --sun 30,60,4                        azimuth from +z to +x, elevation, irradiance
//   --point 0,3,0,9,9,9                  position, intensity
//   --spot 0,3,0,0,-1,0,40,0.2,100W      position, direction, half angle, blend, intensity
//   --sky 0.5,0.6,0.8                    radiance; any text but numbers names a picture
//   --camera 0,1,4,0,1,0                 position, target
//
// A radiance or an intensity is R,G,B or one number for grey. A unit may follow an irradiance or an
// intensity: the lights are kept in W/m^2 and W/sr.
//
// An option's text is checked as soon as it is parsed, so that a wrong one is a usage error. The
// picture of a sky is read later, by sky(): a wrong picture is invalid data.
#include "tools/scene_options.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "engine/base/numbers.h"
#include "engine/io/file/url.h"
#include "engine/io/image/texture.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "tools/common.h"
#include "tools/parse.h"
#include "tools/values.h"

namespace ptc {
namespace {

/// The colour of one number, which is grey, or of three.
glm::vec3 colour_of(std::span<const double> n) {
  return n.size() == 1 ? glm::vec3(glm::dvec3(n[0])) : glm::vec3(n[0], n[1], n[2]);
}

/// Three numbers, or one for grey, from 0 to 1e30.
glm::vec3 parse_colour(const std::string& option, const std::string& text) {
  constexpr char kExpected[] = "R,G,B or one number for grey, from 0 up";
  const glm::vec3 colour = colour_of(parse_numbers(option, text, {1, 3}, kExpected));
  for (int c = 0; c < 3; ++c) {
    if (!(colour[c] >= 0 && colour[c] <= 1e30F)) refuse(option, text, kExpected);
  }
  return colour;
}

/// The luminous flux of 1 W of light of 555 nm, lm: the definition of the candela, and what
/// Blender's glTF exporter takes for all light.

/// Factors from a unit to the one that a light is kept in, by name; "" is for numbers without one.
using Units = std::map<std::string_view, double>;

/// Units of intensity in W/sr. Power is that of a lamp that shines in all directions, also that of
/// a spot light: so Blender and its glTF exporter have it.
const Units& intensity_units() {
  static const Units units{{"", 1},
                           {"W", 0.25 / kPiDouble},
                           {"lm", 0.25 / kPiDouble / kLumensPerWatt},
                           {"cd", 1 / kLumensPerWatt}};
  return units;
}

/// Units of irradiance in W/m^2.
const Units& irradiance_units() {
  static const Units units{{"", 1}, {"lx", 1 / kLumensPerWatt}};
  return units;
}

/// The numbers of a light. Those from the index `strength` on lie between 0 and 1e30 and may be
/// followed by one of `units`; they are returned multiplied by its factor.
std::vector<double> parse_light(const std::string& option, const std::string& text,
                                std::initializer_list<std::size_t> counts, std::size_t strength,
                                const Units& units, const std::string& expected) {
  const std::size_t end = unit_begin(text);
  const auto unit = units.find(std::string_view(text).substr(end));
  auto numbers = split_numbers(std::string_view(text).substr(0, end));
  if (!numbers || unit == units.end() ||
      std::ranges::find(counts, numbers->size()) == counts.end() ||
      (numbers->size() == strength && end != text.size())) {
    refuse(option, text, expected);
  }
  for (double& number : std::span(*numbers).subspan(strength)) {
    number *= unit->second;
    if (!(number >= 0 && number <= 1e30)) refuse(option, text, expected);
  }
  return *std::move(numbers);
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
  for (const std::filesystem::path& file : object_files(files)) {
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
      "The elevation is above the horizon. The azimuth turns from +z to +x where y is up; where z "
      "is "
      "up, as in most scans, from +y to +x: from north to east. The irradiance is that of a "
      "surface that faces the sun, in W/m^2, or in lux: "
      "30,60,2000lx. 1 W/m^2 counts as 683 lx.")
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
      "Point light: position, intensity; repeatable\n"
      "With the unit W the intensity is that of a lamp of this power in Blender, W/sr times 4 pi; "
      "lm is the same in lumens, cd is candela, as in glTF. 1 W counts as 683 lm.")
      ->type_name("X,Y,Z,LIGHT")
      ->group(kGroup);
  add_repeated(
      app, "--spot", [this](const std::vector<std::string>& v) { set_spots(v); },
      "Spot light: position, direction, angle, blend, intensity; repeatable\n"
      "X,Y,Z,DX,DY,DZ,ANGLE,BLEND,LIGHT: 0,3,0,0,-1,0,40,0.2,100W shines straight down. The angle "
      "from the axis to the edge of the cone is in degrees, at most 90: half of Blender's spot "
      "size. The blend, from 0 to 1, is the share of the angle over which the light fades to the "
      "edge. The intensity is that on the axis; W and lm are those of a lamp without the cone, as "
      "in Blender.")
      ->type_name("X,Y,...,LIGHT")
      ->group(kGroup);
  declare_sky(app);
  app_ = &app;
  add_repeated(
      app, "--light-group", [this](const std::vector<std::string>& v) { set_groups(v); },
      "Group of the lights that follow; repeatable\n"
      "ptcshade and ptcrender keep the light of each group apart with --light-groups. The name is "
      "1 to 25 letters from a to z, digits and underscores.")
      ->type_name("NAME")
      ->group(kGroup);
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
      "AZ,EL[,E] with an elevation from -90 to 90 and an irradiance from 0 up, with or without the "
      "unit lx";
  suns_.clear();
  for (const std::string& text : values) {
    const std::vector<double> n =
        parse_light("--sun", text, {2, 3}, 2, irradiance_units(), kExpected);
    const double strength = n.size() == 3 ? n[2] : 3;
    if (std::abs(n[1]) > 90) refuse("--sun", text, kExpected);
    suns_.push_back({n[0], n[1], static_cast<float>(strength)});
  }
}

void LightArguments::set_points(const std::vector<std::string>& values) {
  constexpr char kExpected[] =
      "X,Y,Z,R,G,B or X,Y,Z,I, a position and an intensity from 0 up, with or without the unit W, "
      "lm or cd";
  points_.clear();
  for (const std::string& text : values) {
    const std::vector<double> n =
        parse_light("--point", text, {4, 6}, 3, intensity_units(), kExpected);
    points_.push_back(
        {.position = {n[0], n[1], n[2]}, .intensity = colour_of(std::span(n).subspan(3))});
  }
}

void LightArguments::set_spots(const std::vector<std::string>& values) {
  constexpr char kExpected[] =
      "X,Y,Z,DX,DY,DZ,ANGLE,BLEND,R,G,B or one number in place of R,G,B: a direction that is not "
      "zero, an angle from 0.01 to 90, a blend from 0 to 1 and an intensity from 0 up, with or "
      "without the unit W, lm or cd";
  spots_.clear();
  for (const std::string& text : values) {
    const std::vector<double> n =
        parse_light("--spot", text, {9, 11}, 8, intensity_units(), kExpected);
    const glm::dvec3 direction{n[3], n[4], n[5]};
    const double length = glm::length(direction);
    const double degrees = n[6];
    const double blend = n[7];
    if (!(length > 0 && std::isfinite(length)) || !(degrees >= 0.01 && degrees <= 90) ||
        !(blend >= 0 && blend <= 1)) {
      refuse("--spot", text, kExpected);
    }
    spots_.push_back({.position = {n[0], n[1], n[2]},
                      .direction = glm::vec3(direction / length),
                      .intensity = colour_of(std::span(n).subspan(8)),
                      .inner_angle = static_cast<float>(glm::radians(degrees * (1 - blend))),
                      .outer_angle = static_cast<float>(glm::radians(degrees))});
  }
}

void LightArguments::set_groups(const std::vector<std::string>& values) {
  groups_ = values;
  for (const std::string& name : values) {
    if (!is_group_name(name)) {
      refuse(
          "--light-group", name,
          "1 to 25 letters from a to z, digits and underscores, and not rest, which is all other "
          "light");
    }
  }
}

void LightArguments::assign_groups(LightRig& rig) const {
  if (groups_.empty()) return;
  std::size_t group = 0, sun = 0, point = 0, spot = 0;
  bool used = false;  // the group has a light
  for (const CLI::Option* const option : app_->parse_order()) {
    const std::string name = option->get_name();
    const std::string of = group > 0 ? groups_[group - 1] : "";
    if (name == "--light-group") {
      if (group > 0 && !used) break;
      ++group;
      used = false;
      continue;
    }
    if (name == "--sun") rig.suns[sun++].group = of;
    if (name == "--point") rig.points[point++].group = of;
    if (name == "--spot") rig.spots[spot++].group = of;
    if (name == "--sky") rig.sky.group = of;
    used |= name == "--sun" || name == "--point" || name == "--spot" || name == "--sky";
  }
  if (!used) refuse("--light-group", groups_[group - 1], "a light after the name of its group");
}

bool LightArguments::given() const noexcept {
  return !suns_.empty() || !points_.empty() || !spots_.empty() || !groups_.empty() || sky_given();
}

LightRig LightArguments::rig(const glm::vec3& up, TextureStore& store) const {
  LightRig rig{.points = points_, .spots = spots_, .sky = sky(store)};
  rig.sky.up = up;
  for (const SunPlace& sun : suns_) {
    rig.suns.push_back({.to_sun = sun_direction(sun.azimuth, sun.elevation, up),
                        .irradiance = sun.irradiance * sun_colour_,
                        .angular_radius = static_cast<float>(glm::radians(sun_degrees_ / 2))});
  }
  assign_groups(rig);
  return rig;
}

Sky LightArguments::sky(TextureStore& store) const {
  Sky sky;
  if (sky_.empty()) return sky;
  sky.radiance = sky_radiance_.value_or(glm::vec3(1)) * sky_scale_;
  if (sky_radiance_) return sky;
  check_input(sky_);
  sky.map_path = sky_;
  sky.map = std::make_shared<const Texture>(store.read(sky_));
  return sky;
}

glm::vec3 up_of_files(const std::vector<std::filesystem::path>& files, const std::string& axis) {
  return up_of(axis.empty() ? text_with_up(files) : Texts{{kUpKey, axis}});
}

void note_unknown_up(const std::vector<std::filesystem::path>& files, const std::string& axis,
                     Progress& progress) {
  if (!axis.empty()) return;
  const std::vector<std::filesystem::path> all = object_files(files);
  const auto silent = std::ranges::find_if(
      all, [](const auto& file) { return holds_points(file) && !is_container(file); });
  if (silent == all.end() || !text_with_up(files).empty()) return;
  progress.note(file_name(*silent) +
                ": the file does not say which axis is up, y is taken; --up z if it is z");
}

void add_shadow_rays(CLI::App& app, LightSampling& sampling) {
  add_integer(app, "--sun-rays", sampling.sun_rays, 1, LightSampling::kMost,
              "Shadow rays from each point to each sun")
      ->group(kExpertGroup);
  add_integer(app, "--area-rays", sampling.area_rays, 1, LightSampling::kMost,
              "Shadow rays from each point to what emits light")
      ->group(kExpertGroup);
}

void add_light_sampling(CLI::App& app, LightSampling& sampling) {
  add_shadow_rays(app, sampling);
  add_integer(app, "--sky-rays", sampling.sky_rays, 0, LightSampling::kMost,
              "Shadow rays from each point to the sky")
      ->group(kExpertGroup);
}

CLI::Option* add_layers(CLI::App& app, std::vector<PictureTarget>& layers,
                        std::span<const std::string_view> names,
                        const std::vector<std::string>& endings) {
  std::vector<std::string> words;
  for (const std::string_view name : names) words.push_back(std::string(name) + "=");
  const std::string told = join({words.begin(), words.end() - 1}, ", ") + " or " + words.back();
  words.insert(words.end(), endings.begin(), endings.end());
  const auto check = [names, told, endings](const std::string& text) {
    const std::size_t equals = text.find('=');
    const bool known =
        std::ranges::find(names, text.substr(0, equals)) != names.end() &&
        std::ranges::any_of(endings, [&](const auto& ending) { return has_ending(text, ending); });
    return known && equals != std::string::npos
               ? std::string()
               : "expects " + told + " and the name of a " + join(endings, " or ") + ", not '" +
                     text + "'";
  };
  const auto set = [&layers](const std::vector<std::string>& values) {
    for (const std::string& text : values) {
      const std::size_t equals = text.find('=');
      layers.push_back({text.substr(equals + 1), text.substr(0, equals)});
    }
  };
  CLI::Option* option = app.add_option_function<std::vector<std::string>>(
      "--layer", set,
      "Also write a layer as " + std::string(endings.size() > 1 ? "PNG or mesh" : "PNG") +
          "; repeatable\nLAYER is " + told +
          (std::ranges::find(names, "reflection") != names.end() ? " (with --glossy)." : "."));
  return offer(option, words)
      ->type_name("LAYER=FILE")
      ->group(kFilesGroup)
      ->allow_extra_args(false)
      ->check(check);
}

CLI::Option* add_exposure(CLI::App& app, std::optional<float>& exposure) {
  return app.add_option("--exposure", exposure, "Exposure of a .png, without a curve")
      ->type_name("STOPS")
      ->check(in_range(-64, 64))
      ->default_str("chosen, with a curve");
}

CLI::Option* add_one_sided(CLI::App& app, bool& one_sided) {
  return app
      .add_flag(
          "--one-sided", one_sided,
          "Let only the fronts of OBJ, PLY, STL and OFF reflect\n"
          "These formats do not say whether the back of a triangle reflects, so both sides "
          "do, except on closed surfaces, inside of which all is dark. Fronts are those whose "
          "corners are counter-clockwise.")
      ->group(kFilesGroup);
}

CLI::Option* add_samples(CLI::App& app, unsigned& samples) {
  return add_integer(app, "--samples", samples, 1, 4096, "Samples of each pixel, a square number")
      ->check(CLI::Validator(
          [](std::string& text) {
            const std::uint64_t count = std::stoull(text);
            std::uint64_t side = 1;
            while (side * side < count) ++side;
            return side * side == count ? std::string()
                                        : "expects a square number (1, 4, 9, 16 ...), not " + text;
          },
          ""));
}

CLI::Option* add_size(CLI::App& app, std::optional<std::array<unsigned, 2>>& size, bool square,
                      const std::string& purpose, const std::string& usual) {
  const auto set = [&size, square](const std::string& text) {
    constexpr unsigned kMax = 1 << 16;  // of a side of an EXR
    const char* expected = square ? "WIDTHxHEIGHT or one number for both, 1 to 65536"
                                  : "WIDTHxHEIGHT, such as 960x540, 1 to 65536 each";
    const auto side = [&](std::string_view digits) {
      const auto pixels = parse_number<unsigned>(digits);
      if (!pixels || *pixels < 1 || *pixels > kMax) refuse("--size", text, expected);
      return *pixels;
    };
    const std::size_t cross = text.find('x');
    const std::string_view whole = text;
    if (cross == std::string::npos && !square) refuse("--size", text, expected);
    const unsigned width = side(whole.substr(0, cross));
    size = {width, cross == std::string::npos ? width : side(whole.substr(cross + 1))};
  };
  return app.add_option_function<std::string>("--size", set, purpose)
      ->type_name(square ? "N|WxH" : "WxH")
      ->default_str(usual);
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
  add_size(app, size_, false, "Width and height of the picture, in pixels",
           std::to_string(camera_.width) + "x" + std::to_string(camera_.height))
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

std::optional<Camera> CameraArguments::camera() const {
  if (!given_) return {};
  Camera camera = camera_;
  if (size_) {
    camera.width = (*size_)[0];
    camera.height = (*size_)[1];
  }
  return camera;
}

void SequenceArguments::declare(CLI::App& app) {
  constexpr char kGroup[] = "Sequence";
  const auto set_frames = [this](const std::string& text) {
    constexpr char kExpected[] = "A-B or A-BxS with the first and the last frame, and a step";
    // A minus sign may stand before each number
    const std::size_t dash = text.find('-', 1), cross = text.find('x');
    const auto number = [&](std::size_t from, std::size_t to) {
      const auto value = parse_number<std::int64_t>(std::string_view(text).substr(from, to - from));
      if (!value) refuse("--frames", text, kExpected);
      return *value;
    };
    FrameRange range;
    range.first = range.last = number(0, std::min({dash, cross, text.size()}));
    if (dash != std::string::npos) range.last = number(dash + 1, std::min(cross, text.size()));
    if (cross != std::string::npos) range.step = number(cross + 1, text.size());
    frames_ = range;
  };
  app.add_option_function<std::string>(
         "--frames", set_frames,
         "Frames to render, such as 1-100, or 1-100x2 for every second one\n"
         "In the name of each output #### stands for the number of the frame, with zeros in front; "
         "%04d does the same. The exposure of the first frame serves all.")
      ->type_name("A-B[xS]")
      ->group(kGroup);
  add_number(app, "--fps", request_.frames_per_second, 1e-6, 1e6,
             "Frames a second of animations of glTF")
      ->group(kGroup);
  add_integer(app, "--turntable", request_.turntable, 1, 100'000,
              "Go once around what is seen, in frames 1 to N")
      ->type_name("N")
      ->default_str("")
      ->group(kGroup);
}

std::optional<SequenceRequest> SequenceArguments::sequence() const {
  if (!frames_ && request_.turntable == 0) return {};
  SequenceRequest request = request_;
  request.frames = frames_.value_or(FrameRange{1, std::int64_t{request_.turntable}});
  return request;
}

}  // namespace ptc
