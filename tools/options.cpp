// Codecs, page sizes, lighting and expert settings from the command line.
#include "tools/options.h"

#include <algorithm>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/numbers.h"
#include "tools/values.h"

namespace ptc {

std::vector<std::string> mesh_endings() {
  return {".obj",    ".obj.gz", ".ply", ".ply.gz", ".off",
          ".off.gz", ".gltf",   ".glb", ".stl",    ".scene.json"};
}

std::vector<std::string> input_endings() {
  std::vector<std::string> endings = mesh_endings();
  for (std::string& cloud : cloud_endings()) {
    if (std::ranges::find(endings, cloud) == endings.end()) endings.push_back(std::move(cloud));
  }
  return endings;
}

std::vector<std::string> cloud_endings() {
  return {".las", ".laz", ".e57", ".ply", ".ply.gz", ".pcd",  ".xyz", ".xyzn", ".asc",
          ".txt", ".csv", ".pts", ".ptx", ".ptc",    ".bgeo", ".geo", ".pdb"};
}

std::vector<std::string> point_output_endings() {
  return {".las", ".ply", ".xyz", ".pcd", ".ptc", ".bgeo", ".usda", ".usdc"};
}

CLI::Option* add_original_order(CLI::App& app, bool& original_order,
                                const std::string& description) {
  return app.add_flag("--original-order", original_order, description);
}

CLI::Option* add_up(CLI::App& app, std::string& axis) {
  return offer(app.add_option("--up", axis,
                              "Axis that points up: x, y or z [default: as the files say, else y]\n"
                              "LAS, LAZ, E57, PTX, PTS and PCD say z."),
               {"x", "y", "z"})
      ->type_name("AXIS")
      ->check(CLI::IsMember({"x", "y", "z"}));
}

CLI::Option* add_colour_from(CLI::App& app, std::string& channel) {
  return app
      .add_option("--colour-from", channel,
                  "Channel that viewers show as colour, such as occlusion or indirect\n"
                  "Formats with a colour for each point get it in place of the points' own colour, "
                  "which is kept in a .ptcx alone. One component is a grey, white for occlusion 0; "
                  "three are light, which is compressed to what a screen shows.")
      ->type_name("CHANNEL");
}

void add_selection(CLI::App& app, Selection& selection) {
  constexpr char kGroup[] = "Selection";
  app.add_option_function<std::string>(
         "--bbox",
         [&selection](const std::string& text) {
           const std::vector<double> n =
               parse_numbers("--bbox", text, {6}, "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX");
           selection.box = Bounds{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
           for (int axis = 0; axis < 3; ++axis) {
             if (selection.box->low[axis] > selection.box->high[axis])
               refuse("--bbox", text, "minima that are not above the maxima");
           }
         },
         "Box from which points are taken, in scene units\n"
         "Points on its faces are taken, too. Of a container only the pages are read that may hold "
         "such points.")
      ->type_name("BOX")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--class",
         [&selection](const std::string& text) {
           for (const std::string& word : split(text, ',')) {
             const auto number = parse_number<std::uint64_t>(word);
             if (!number) refuse("--class", text, "whole numbers separated by commas");
             selection.classes.push_back(*number);
           }
         },
         "Classes that are taken, such as 2 for ground or 2,6\n"
         "They are values of the channel classification, which LAS has for each point.")
      ->type_name("LIST")
      ->group(kGroup);
  add_integer(app, "--every", selection.every, 1, std::uint64_t{1} << 48,
              "Take the first of every N points\n"
              "It counts the points that meet all other conditions.")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--channels",
         [&selection](const std::string& text) { selection.channels = split(text, ','); },
         "Names of the channels to keep, separated by commas\n"
         "The other ones are left out. Position, normal, radius, colour and light are no channels, "
         "and stay.")
      ->type_name("LIST")
      ->group(kGroup);
}

CLI::Option* add_level(CLI::App& app, Selection& selection) {
  return app
      .add_option_function<unsigned>(
          "--level", [&selection](unsigned level) { selection.level = level; },
          "Level of the octree whose clusters stand for the points\n"
          "Level 1 has at most eight, and each further level up to eight times as many as the one "
          "above it; leaves above the level stand for themselves. Clusters have a normal, a radius "
          "and radiance, but no channels.")
      ->type_name("N")
      ->check(whole_in_range(1, 62))
      ->group("Selection");
}

void note_unused(const CLI::App& app, const std::vector<std::string>& options,
                 const std::string& because, Progress& progress) {
  std::vector<std::string> given;
  for (const std::string& option : options) {
    if (app.count(option) > 0) given.push_back(option);
  }
  if (given.empty()) return;
  progress.note(join(given, ", ") + (given.size() == 1 ? " has" : " have") +
                " no effect, because " + because);
}

CLI::Option* add_points(CLI::App& app, std::uint64_t& count) {
  return add_count(app, "--points", count,
                   "Number of surfels to place on the meshes, about\n"
                   "The number is met within 2 %, less the surfels that lie buried inside solids "
                   "and are left out. Clouds keep their points.")
      ->default_str(std::to_string(count / 1'000'000) + "M")
      ->group("Sampling");
}

CLI::Option* add_profile(CLI::App& app, Profile& profile) {
  return add_choice<Profile>(app, "--profile", profile,
                             {{"raw", Profile::raw},
                              {"exact", Profile::exact},
                              {"fast", Profile::fast},
                              {"compact", Profile::compact}},
                             "How points are stored: raw, exact, fast or compact\n"
                             "raw keeps points as they lie in memory. exact compresses them "
                             "without loss. fast and compact round them to 0.001 of their radius: "
                             "fast decodes in less time, compact takes fewer bytes.");
}

CLI::Option* add_page_size(CLI::App& app, std::uint8_t& page_shift) {
  std::vector<std::pair<std::string, std::uint8_t>> sizes;
  for (std::uint8_t shift = 12; shift < 20; ++shift) {
    sizes.emplace_back(std::to_string(1U << (shift - 10)) + "K", shift);
  }
  sizes.emplace_back("1M", 20);
  return add_choice<std::uint8_t>(app, "--page-size", page_shift, sizes,
                                  "Bytes of a page: a power of two from 4K to 1M")
      ->type_name("SIZE");
}

CLI::Option* add_back_end(CLI::App& app, BackEnd& back_end) {
  return add_choice<BackEnd>(app, "--io", back_end,
                             {{"pread", BackEnd::pread},
                              {"mmap", BackEnd::mmap},
                              {"direct", BackEnd::direct},
                              {"io_uring", BackEnd::io_uring}},
                             "How pages are read: pread, mmap, direct or io_uring\n"
                             "pread reads through the file cache of the system. mmap reads in "
                             "place from that cache; the file must not change meanwhile. direct "
                             "bypasses the cache. io_uring bypasses it, too, and reads the next "
                             "page in the background.")
      ->group(kExpertGroup);
}

CLI::Option* add_bounces(CLI::App& app, unsigned& bounces) {
  return add_integer(app, "--bounces", bounces, 0, 1000,
                     "Bounces of light; 0 gives occlusion and sky alone\n"
                     "Every bounce but the last shades all points of the scene once more. 0 takes "
                     "less time than 1.");
}

void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift) {
  add_number(app, "--solid-angle", gather.solid_angle, 1e-6, 4 * kPiDouble,
             "Solid angle in sr up to which a cluster is not opened")
      ->type_name("SR")
      ->group(kExpertGroup);
  add_number(app, "--parallax", gather.parallax, 0, kPiDouble,
             "Angle in rad within which receivers share a cluster\n"
             "Receivers form groups. A cluster whose directions from a group differ by less than "
             "this is drawn once for the whole group.")
      ->type_name("RAD")
      ->group(kExpertGroup);
  add_number(app, "--inflation", gather.inflation, 0.01, 100,
             "Maximum footprint of a cluster over its projected area\n"
             "The limit holds for clusters that are not flat.")
      ->type_name("FACTOR")
      ->group(kExpertGroup);
  add_integer(app, "--resolution", gather.resolution, 16, 64,
              "Pixels along an edge of the direction cube\n"
              "A multiple of 16, from 16 to 64.")
      ->check([](const std::string& text) {
        const auto value = parse_number<unsigned>(text);
        return value && *value % 16 == 0 ? std::string() : "must be a multiple of 16, is " + text;
      })
      ->type_name("PIXELS")
      ->group(kExpertGroup);
  add_choice<Sides>(app, "--sides", gather.sides, {{"both", Sides::both}, {"front", Sides::front}},
                    "Sides of a surfel that block light: both or front\n"
                    "front is faster, and right where no back side is ever seen.")
      ->group(kExpertGroup);
  add_number(app, "--lift", lift, 0, 100, "Height of receivers above their surfel, in its radii")
      ->type_name("RADII")
      ->group(kExpertGroup);
}

void add_surroundings(CLI::App& app, Surroundings& around) {
  constexpr char kGroup[] = "Occlusion";
  CLI::Option* sphere =
      app.add_flag(
             "--sphere", around.sphere,
             "Let all directions count alike, whatever the normal\n"
             "By default those above the surface count, by their cosine to the normal. Over the "
             "sphere the occlusion of an open plane is 0.5, and normals do not matter.")
          ->group(kGroup);
  app.add_option_function<double>(
         "--cone",
         [&around](double degrees) { around.cone = static_cast<float>(degrees * kPiDouble / 180); },
         "Half angle of the cone in which directions count\n"
         "Its axis is the normal; 90 degrees are the hemisphere.")
      ->type_name("DEGREES")
      ->check(in_range(1, 90))
      ->default_str("90")
      ->excludes(sphere)
      ->group(kGroup);
  CLI::Option* distance =
      app.add_option(
             "--distance", around.distance,
             "Distance from which on surfaces cover nothing, in scene units\n"
             "Closed rooms, which are dark otherwise, then show their corners. The light of "
             "surfaces counts from any distance.")
          ->type_name("LENGTH")
          ->check(in_range(1e-30, 1e30))
          ->default_str("")
          ->group(kGroup);
  add_integer(app, "--falloff", around.falloff, 0, 8,
              "How covering decreases with the distance\n"
              "A surface at the distance d covers the share (1 - d / LENGTH)^N of its direction; 0 "
              "covers all of it up to LENGTH.")
      ->needs(distance)
      ->group(kGroup);
}

void add_shadows(CLI::App& app, std::vector<std::string>& shadows, const std::string& where) {
  app.add_option("--shadow", shadows,
                 "Also write the shadow of a group of lights; repeatable\n"
                 "The " +
                     where +
                     " shadow_NAME is the share of the light of the group's suns, point and spot "
                     "lights that something hides, 0 to 1; 1 where the surface is turned away. "
                     "--light-group names groups, in this run or where the scene was lit.")
      ->type_name("NAME")
      ->allow_extra_args(false)
      ->group("Lights");
}

void add_glossy(CLI::App& app, GlossyRequest& glossy, const std::string& where) {
  constexpr char kGroup[] = "Reflections";
  app.add_option_function<float>(
         "--glossy", [&glossy](const float& roughness) { glossy.roughness = roughness; },
         "Also write what surfaces would reflect as rough mirrors\n"
         "ROUGHNESS is that of glTF and of most renderers: 0 is a polished mirror, 1 is dull. "
         "The " +
             where +
             "s are reflection, the radiance of a mirror that absorbs nothing, and "
             "reflection_occlusion, the share of what it shows that surfaces cover. Emitters and "
             "the sky are reflected; suns, point and spot lights are not.")
      ->type_name("ROUGHNESS")
      ->check(in_range(0, 1))
      ->group(kGroup);
  add_integer(app, "--glossy-rays", glossy.rays, 1, 1 << 18,
              "Rays of each receiver of --glossy [default: 64, or what --error takes]")
      ->default_str("")
      ->needs("--glossy")
      ->group(kGroup);
}

void add_preset(CLI::App& app, Preset& preset) {
  add_choice<Preset>(
      app, "--preset", preset,
      {{"scan", Preset::scan}, {"interior", Preset::interior}, {"film", Preset::film}},
      "Settings for a kind of scene: scan, interior or film\n"
      "scan: occlusion and sky alone, with an error of 5 % (--bounces 0 --error 5%). interior: "
      "surfaces cover up to a tenth of the diagonal of the scene, so that closed rooms show their "
      "corners (--distance). film: an error of 2 % (--error 2%). Other options win over those of "
      "a preset.")
      ->default_str("")
      ->group("Occlusion");
}

void apply_preset(const CLI::App& app, Preset preset, LightingRequest& request) {
  constexpr float kDiagonals = 0.1F;
  const auto given = [&](std::initializer_list<const char*> options) {
    return std::ranges::any_of(options, [&](const char* o) { return app.count(o) > 0; });
  };
  const bool has_quality =
      given({"--error", "--solid-angle", "--parallax", "--inflation", "--resolution"});
  switch (preset) {
    case Preset::scan:
      if (!given({"--bounces"})) request.bounces = 0;
      if (!has_quality) request.error = 0.05;
      break;
    case Preset::interior:
      if (!given({"--distance"})) request.gather.around.diagonals = kDiagonals;
      break;
    case Preset::film:
      if (!has_quality) request.error = 0.02;
      break;
    case Preset::none:
      break;
  }
}

CLI::Option* add_share(CLI::App& app, const char* name, std::optional<double>& share,
                       const std::string& help) {
  const auto set = [name, &share](const std::string& text) {
    const bool percent = text.ends_with('%');
    const auto number =
        parse_number<double>(std::string_view(text).substr(0, text.size() - (percent ? 1 : 0)));
    const double value = number.value_or(0) / (percent ? 100 : 1);
    if (!(value > 0 && value <= 1))
      refuse(name, text, "a share above 0 and at most 1, such as 2% or 0.02");
    share = value;
  };
  return app.add_option_function<std::string>(name, set, help)->type_name("SHARE");
}

CLI::Option* add_tolerance(CLI::App& app, std::optional<double>& tolerance) {
  return add_share(
      app, "--tolerance", tolerance,
      "Store points in fewer bytes, with an RMS error of at most SHARE\n"
      "SHARE is a percentage or a number up to 1: 3% and 0.03 are the same. Surfels of a cell that "
      "is flat and evenly lit become one, and what is left is rounded more coarsely. How far this "
      "goes is tried in temporary containers: the error is that of occlusion and of light at 2,048 "
      "points, by rays at what is stored against rays at all points, and that of the light that "
      "points send out and of their albedo. Where even the finest rounding, 0.23 % off, is too "
      "coarse, the report says so. Points with channels, such as the intensity of a scan, are "
      "rounded alone. "
      "ptcinfo --why tells what was chosen.");
}

void add_error_option(CLI::App& app, std::optional<double>& error) {
  CLI::Option* option = add_share(
      app, "--error", error,
      "Find the cheapest settings whose RMS error is at most SHARE, such as 2%\n"
      "SHARE is a percentage or a number up to 1: 2% and 0.02 are the same. The error is that of "
      "occlusion and of light, each relative to its mean, against rays that are traced at the "
      "surfels. Settings are tried at pilot receivers. The cheapest ones that meet the error are "
      "used, or rays where these are cheaper; if none does, the finest are used, and the report "
      "says so. By default the expert "
      "settings hold.");
  option->group("Quality");
  for (const char* name : {"--solid-angle", "--parallax", "--inflation", "--resolution"}) {
    option->excludes(app.get_option(name));
  }
}

void add_estimate_option(CLI::App& app, bool& estimate) {
  app.add_flag("--estimate", estimate,
               "Also write the estimated error of each receiver\n"
               "The channels are occlusion_error and irradiance_error. Requires --error or "
               "--check.")
      ->group("Quality");
}

void add_tolerate_damage(CLI::App& app, bool& tolerate) {
  app.add_flag("--tolerate-damage", tolerate,
               "Go on past damaged pages of the scene [default: stop]\n"
               "The cluster above a damaged page stands in for it. The points on the page are left "
               "out. The report states how many points that are, and a bound on the error.")
      ->group("Quality");
}

void add_light_groups(CLI::App& app, bool& groups, const std::string& where) {
  app.add_flag("--light-groups", groups,
               "Keep the light of each group of lights apart, in " + where +
                   " light_NAME\n"
                   "ptclight, ptcbuild and ptcrender name groups with --light-group; all other "
                   "light is light_rest. The sum is all light, so that groups can be weighted and "
                   "coloured anew without another run. A run takes as long as one run for each "
                   "group, and disk space for a copy of the scene for each.")
      ->group("Lights");
}

void add_check_options(CLI::App& app, CheckRequest& check) {
  add_integer(app, "--check", check.receivers, 0, 10'000'000,
              "Number of receivers to compare with traced rays\n"
              "The report states the error of occlusion and of irradiance at these receivers.")
      ->group("Quality");
  add_integer(app, "--check-rays", check.rays, 1, 1 << 18, "Rays for each receiver of --check")
      ->group("Quality");
}

void add_quality_options(CLI::App& app, LightingRequest& request) {
  add_gather_options(app, request.gather, request.lift);
  add_error_option(app, request.error);
  add_check_options(app, request.check);
  add_estimate_option(app, request.estimate);
  add_tolerate_damage(app, request.tolerate_damage);
}

}  // namespace ptc
