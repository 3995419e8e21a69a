// Parsing of what CLI11 does not know: numbers with commas, counts, lights.
#include "tools/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "engine/base/error.h"
#include "engine/io/image.h"
#include "tools/common.h"

namespace ptc {
namespace {

/// The number that the whole of `text` spells; empty when it spells none, or none that is finite.
template <class T>
std::optional<T> parse_number(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return {};
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) return {};
  }
  return value;
}

/// A number before one of some suffixes, or without; NaN when it is none.
double parse_scaled(std::string_view text, const std::map<std::string_view, double>& suffixes) {
  const std::size_t end = text.find_last_of("0123456789.") + 1;
  const auto number = parse_number<double>(text.substr(0, end));
  const auto factor = suffixes.find(text.substr(end));
  const bool known = end == text.size() || factor != suffixes.end();
  if (!number || !known) return std::nan("");
  return end == text.size() ? *number : *number * factor->second;
}

[[noreturn]] void refuse(const std::string& option, const std::string& text, const char* expected) {
  throw CLI::ValidationError(option, std::string("expects ") + expected + ", not '" + text + "'");
}

/// As many numbers as one of `counts` says.
std::vector<double> parse_numbers(const std::string& option, const std::string& text,
                                  std::initializer_list<std::size_t> counts, const char* expected) {
  std::vector<double> numbers = ptc::parse_numbers(option, text);
  for (const std::size_t count : counts) {
    if (numbers.size() == count) return numbers;
  }
  refuse(option, text, expected);
}

glm::vec3 parse_colour(const std::string& option, const std::string& text) {
  constexpr char kExpected[] = "R,G,B or one number for grey, none negative";
  const std::vector<double> n = parse_numbers(option, text, {1, 3}, kExpected);
  const glm::vec3 colour =
      n.size() == 1 ? glm::vec3(glm::dvec3(n[0])) : glm::vec3(n[0], n[1], n[2]);
  for (int c = 0; c < 3; ++c) {
    if (!(colour[c] >= 0 && colour[c] <= 1e30F)) refuse(option, text, kExpected);
  }
  return colour;
}

/// Towards the sun: azimuth 0 is +z, 90 is +x; elevation 90 is +y.
glm::vec3 sun_direction(double azimuth_degrees, double elevation_degrees) {
  const double azimuth = glm::radians(azimuth_degrees);
  const double elevation = glm::radians(elevation_degrees);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

std::string range_text(const std::string& least, const std::string& most) {
  return "expects a number from " + least + " to " + most;
}

template <class T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::vector<std::pair<std::string, T>>& choices,
                        const std::string& description) {
  std::string names;
  std::string current;
  for (const auto& [text, choice] : choices) {
    names += (names.empty() ? "" : "|") + text;
    if (choice == value) current = text;
  }
  const auto set = [&value, choices, name, names](const std::string& text) {
    const auto chosen = std::ranges::find(choices, text, &std::pair<std::string, T>::first);
    if (chosen == choices.end()) refuse(name, text, names.c_str());
    value = chosen->second;
  };
  return app.add_option_function<std::string>(name, set, description)
      ->type_name(names)
      ->default_str(current);
}

CLI::Option* add_repeated(CLI::App& app, const std::string& name,
                          const std::function<void(const std::vector<std::string>&)>& set,
                          const std::string& description) {
  return app.add_option_function<std::vector<std::string>>(name, set, description)
      ->allow_extra_args(false);
}

}  // namespace

std::vector<double> parse_numbers(const std::string& option, const std::string& text) {
  std::vector<double> numbers;
  std::string_view rest = text;
  while (true) {
    const std::size_t comma = rest.find(',');
    const auto number = parse_number<double>(rest.substr(0, comma));
    if (!number) refuse(option, text, "finite numbers separated by commas");
    numbers.push_back(*number);
    if (comma == std::string_view::npos) return numbers;
    rest.remove_prefix(comma + 1);
  }
}

std::uint64_t parse_count(const std::string& option, const std::string& text) {
  constexpr double kGreatest = 0x1p48;  // points of a file
  const double count = parse_scaled(text, {{"k", 1e3}, {"K", 1e3}, {"M", 1e6}, {"G", 1e9}});
  if (!(count >= 1 && count <= kGreatest) || std::rint(count) != count) {
    refuse(option, text, "a whole number from 1 to 2^48, as 250000, 250k or 1.5M");
  }
  return static_cast<std::uint64_t>(count);
}

std::uint64_t parse_size(const std::string& option, const std::string& text) {
  constexpr double kGreatest = 0x1p62;
  const double bytes = parse_scaled(text, {{"K", 0x1p10},
                                           {"M", 0x1p20},
                                           {"G", 0x1p30},
                                           {"T", 0x1p40},
                                           {"KiB", 0x1p10},
                                           {"MiB", 0x1p20},
                                           {"GiB", 0x1p30},
                                           {"TiB", 0x1p40}});
  if (!(bytes >= 1 && bytes <= kGreatest))
    refuse(option, text, "a size as 800000000, 256M or 1.5G");
  return static_cast<std::uint64_t>(bytes);
}

CLI::Validator detail::in_range(double least, double most) {
  const auto text = [](double x) {
    std::string digits(32, '\0');
    digits.resize(static_cast<std::size_t>(
        std::to_chars(digits.data(), digits.data() + digits.size(), x).ptr - digits.data()));
    return digits;
  };
  const std::string expects = range_text(text(least), text(most));
  return CLI::Validator(
      [=](std::string& input) {
        const auto value = parse_number<double>(input);
        return value && *value >= least && *value <= most ? std::string()
                                                          : expects + ", not '" + input + "'";
      },
      "");
}

CLI::Validator detail::whole_in_range(std::uint64_t least, std::uint64_t most) {
  const std::string expects = range_text(std::to_string(least), std::to_string(most));
  return CLI::Validator(
      [=](std::string& input) {
        const auto value = parse_number<std::uint64_t>(input);
        return value && *value >= least && *value <= most ? std::string()
                                                          : expects + ", not '" + input + "'";
      },
      "");
}

CLI::Option* add_size(CLI::App& app, const std::string& name, std::uint64_t& bytes,
                      const std::string& description) {
  const std::uint64_t mebibytes = bytes >> 20;
  const bool whole = mebibytes % 1024 == 0;
  return app
      .add_option_function<std::string>(
          name, [&bytes, name](const std::string& text) { bytes = parse_size(name, text); },
          description)
      ->type_name("SIZE")
      ->default_str(whole ? std::to_string(mebibytes / 1024) + "G"
                          : std::to_string(mebibytes) + "M");
}

CLI::Option* add_points(CLI::App& app, std::uint64_t& count) {
  return app
      .add_option_function<std::string>(
          "--points", [&count](const std::string& text) { count = parse_count("--points", text); },
          "Surfels wanted on the meshes; k, M, G count by 1000")
      ->type_name("COUNT")
      ->default_str(std::to_string(count / 1'000'000) + "M")
      ->group("Sampling");
}

CLI::Option* add_codec(CLI::App& app, Codec& codec) {
  return add_choice<Codec>(app, "--codec", codec, {{"raw", Codec::raw}, {"zstd", Codec::zstd}},
                           "Compression of pages");
}

CLI::Option* add_page_size(CLI::App& app, std::uint8_t& page_shift) {
  std::vector<std::pair<std::string, std::uint8_t>> sizes;
  for (std::uint8_t shift = 12; shift < 20; ++shift) {
    sizes.emplace_back(std::to_string(1U << (shift - 10)) + "K", shift);
  }
  sizes.emplace_back("1M", 20);
  return add_choice<std::uint8_t>(app, "--page-size", page_shift, sizes, "Bytes of a page")
      ->type_name("SIZE");
}

CLI::Option* add_access(CLI::App& app, ContainerReader::Access& access) {
  using Access = ContainerReader::Access;
  return add_choice<Access>(app, "--io", access, {{"pread", Access::pread}, {"mmap", Access::mmap}},
                            "How pages are read; mmap: for files that do not change meanwhile")
      ->group("Expert");
}

void LightArguments::declare(CLI::App& app) {
  constexpr char kGroup[] = "Lights";
  add_repeated(
      app, "--sun", [this](const std::vector<std::string>& v) { set_suns(v); },
      "A sun: azimuth from +z to +x and elevation, degrees; irradiance [3]; repeatable")
      ->type_name("AZIMUTH,ELEVATION[,STRENGTH]")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--sun-colour",
         [this](const std::string& t) { sun_colour_ = parse_colour("--sun-colour", t); },
         "Multiplies the strength of all suns")
      ->type_name("R,G,B")
      ->default_str("1,1,1")
      ->group(kGroup);
  add_number(app, "--sun-size", sun_degrees_, 0, 90, "Angular diameter of the suns, degrees")
      ->group(kGroup);
  add_repeated(
      app, "--point", [this](const std::vector<std::string>& v) { set_points(v); },
      "A point light and its intensity, W / sr; repeatable")
      ->type_name("X,Y,Z,R,G,B")
      ->group(kGroup);
  declare_sky(app);
}

void LightArguments::declare_sky(CLI::App& app) {
  const auto set = [this](const std::string& text) {
    sky_ = text;
    sky_radiance_.reset();
    // What begins like a number is one: a picture of that name can be given as ./1.exr.
    if (text.find_first_not_of("0123456789.,+-eE") == std::string::npos) {
      sky_radiance_ = parse_colour("--sky", text);
    }
  };
  app.add_option_function<std::string>(
         "--sky", set, "Radiance from everywhere, or a latitude-longitude picture of it")
      ->type_name("R,G,B|L|FILE")
      ->group("Lights");
  add_number(app, "--sky-scale", sky_scale_, 0, 1e6, "Multiplies the sky")->group("Lights");
}

void LightArguments::set_suns(const std::vector<std::string>& values) {
  constexpr char kExpected[] =
      "AZIMUTH,ELEVATION[,STRENGTH], elevation -90 to 90, strength not negative";
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
  constexpr char kExpected[] = "X,Y,Z,R,G,B, no colour negative";
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

LightRig LightArguments::default_rig() {
  LightRig rig;
  rig.suns.push_back({.to_sun = sun_direction(40, 50), .irradiance = glm::vec3(3)});
  rig.sky.radiance = 0.8F * glm::vec3(0.85F, 0.93F, 1.0F);
  return rig;
}

bool meshes_are_dark(const BuildRequest& request) {
  const Mesh mesh = load_meshes(request.inputs, false);
  const auto emits = [](const Material& material) { return material.emission != glm::vec3(0); };
  return !mesh.triangles.empty() && std::ranges::none_of(mesh.materials, emits);
}

void add_light_sampling(CLI::App& app, LightSampling& sampling) {
  constexpr char kGroup[] = "Expert";
  constexpr std::uint64_t kMost = 1 << 16;
  add_integer(app, "--sun-rays", sampling.sun_rays, 1, kMost, "Shadow rays of a point to each sun")
      ->group(kGroup);
  add_integer(app, "--sky-rays", sampling.sky_rays, 0, kMost, "Shadow rays of a point to the sky")
      ->group(kGroup);
  add_integer(app, "--area-rays", sampling.area_rays, 0, kMost,
              "Shadow rays of a point to emissive triangles")
      ->group(kGroup);
}

void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift) {
  constexpr char kGroup[] = "Expert";
  constexpr double kPi = 3.141592653589793;
  add_number(app, "--solid-angle", gather.solid_angle, 1e-6, 4 * kPi,
             "Clusters below it are not opened, sr")
      ->group(kGroup);
  add_number(app, "--parallax", gather.parallax, 0, kPi,
             "Receivers that see a cluster within this angle share it, rad")
      ->group(kGroup);
  add_number(app, "--inflation", gather.inflation, 0.01, 100,
             "Footprint of a cluster that is not flat over its projected area")
      ->group(kGroup);
  add_integer(app, "--resolution", gather.resolution, 8, 64, "Direction pixels along a cube edge")
      ->group(kGroup);
  add_choice<Sides>(app, "--sides", gather.sides, {{"both", Sides::both}, {"front", Sides::front}},
                    "Which sides of a surfel stop light")
      ->group(kGroup);
  add_number(app, "--lift", lift, 0, 100, "Receivers rise above their surfel by so many radii")
      ->group(kGroup);
}

void add_check_options(CLI::App& app, CheckRequest& check) {
  constexpr char kGroup[] = "Check";
  add_integer(app, "--check", check.receivers, 0, 10'000'000,
              "Compare so many of the receivers with rays, outside the memory cap")
      ->group(kGroup);
  add_integer(app, "--check-rays", check.rays, 1, 1 << 24, "Rays for each of them")->group(kGroup);
}

void CameraArguments::declare(CLI::App& app, const std::string& purpose) {
  app.add_option_function<std::string>(
         "--camera", [this](const std::string& text) { set_place(text); }, purpose)
      ->type_name("PX,PY,PZ,TX,TY,TZ")
      ->group("Camera");
  app.add_option_function<double>(
         "--fov",
         [this](const double& degrees) {
           camera_.vertical_fov = static_cast<float>(glm::radians(degrees));
         },
         "Vertical field of view of --camera, degrees")
      ->type_name("NUMBER")
      ->default_str("40.1")
      ->check(detail::in_range(0.01, 179))
      ->needs("--camera")
      ->group("Camera");
  app.add_option_function<std::string>(
         "--size", [this](const std::string& text) { set_size(text); }, "Pixels of its picture")
      ->type_name("WIDTHxHEIGHT")
      ->default_str(std::to_string(camera_.width) + "x" + std::to_string(camera_.height))
      ->group("Camera");
}

void CameraArguments::set_place(const std::string& text) {
  constexpr char kExpected[] = "PX,PY,PZ,TX,TY,TZ: two different places";
  const std::vector<double> n = parse_numbers("--camera", text, {6}, kExpected);
  camera_.position = {n[0], n[1], n[2]};
  camera_.look_at = {n[3], n[4], n[5]};
  if (camera_.position == camera_.look_at) refuse("--camera", text, kExpected);
  given_ = true;
}

void CameraArguments::set_size(const std::string& text) {
  constexpr unsigned kMost = 1 << 16;  // of an EXR
  const std::size_t cross = text.find('x');
  const auto side = [&](std::string_view digits) {
    const auto pixels = parse_number<unsigned>(digits);
    if (!pixels || *pixels < 1 || *pixels > kMost) {
      refuse("--size", text, "WIDTHxHEIGHT, 1 to 65536 each");
    }
    return *pixels;
  };
  if (cross == std::string::npos) refuse("--size", text, "WIDTHxHEIGHT, as 960x540");
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
