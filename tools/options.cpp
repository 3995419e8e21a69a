// Codecs, page sizes and expert settings from the command line.
#include "tools/options.h"

#include <string>
#include <utility>
#include <vector>

#include "engine/base/numbers.h"
#include "tools/values.h"

namespace ptc {

CLI::Option* add_points(CLI::App& app, std::uint64_t& count) {
  return add_count(app, "--points", count, "Surfels wanted on the meshes; k, M, G count by 1000")
      ->default_str(std::to_string(count / 1'000'000) + "M")
      ->group("Sampling");
}

CLI::Option* add_profile(CLI::App& app, Profile& profile) {
  return add_choice<Profile>(
      app, "--profile", profile,
      {{"raw", Profile::raw},
       {"exact", Profile::exact},
       {"fast", Profile::fast},
       {"compact", Profile::compact}},
      "How points are kept: exact ones as they lie in memory (raw) or compressed; rounded to "
      "0.001 of their radius, to decode fast or to be small");
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

CLI::Option* add_back_end(CLI::App& app, BackEnd& back_end) {
  return add_choice<BackEnd>(app, "--io", back_end,
                             {{"pread", BackEnd::pread},
                              {"mmap", BackEnd::mmap},
                              {"direct", BackEnd::direct},
                              {"io_uring", BackEnd::io_uring}},
                             "How pages are read. pread: through the system's file cache; mmap: "
                             "from it in place, for files "
                             "that do not change meanwhile; direct: past it; io_uring: past it, "
                             "the next page meanwhile")
      ->group("Expert");
}

CLI::Option* add_bounces(CLI::App& app, unsigned& bounces) {
  return add_integer(app, "--bounces", bounces, 0, 1000,
                     "Bounces of light off surfaces; each after the first shades all points of the "
                     "scene once more. "
                     "0: occlusion and sky alone, in less time");
}

void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift) {
  constexpr char kGroup[] = "Expert";
  add_number(app, "--solid-angle", gather.solid_angle, 1e-6, 4 * kPiDouble,
             "Clusters below it are not opened, sr")
      ->group(kGroup);
  add_number(app, "--parallax", gather.parallax, 0, kPiDouble,
             "Receivers that see a cluster within this angle share it, rad")
      ->group(kGroup);
  add_number(app, "--inflation", gather.inflation, 0.01, 100,
             "Footprint of a cluster that is not flat over its projected area, at most")
      ->group(kGroup);
  add_integer(app, "--resolution", gather.resolution, 16, 64,
              "Direction pixels along a cube edge, a multiple of 16")
      ->check([](const std::string& text) {
        const auto value = parse_number<unsigned>(text);
        return value && *value % 16 == 0 ? std::string() : "must be a multiple of 16, is " + text;
      })
      ->group(kGroup);
  add_choice<Sides>(app, "--sides", gather.sides, {{"both", Sides::both}, {"front", Sides::front}},
                    "Which sides of a surfel stop light")
      ->group(kGroup);
  add_number(app, "--lift", lift, 0, 100, "Receivers rise above their surfel by so many radii")
      ->group(kGroup);
}

void add_error_option(CLI::App& app, std::optional<double>& error) {
  const auto set = [&error](const std::string& text) {
    const bool percent = text.ends_with('%');
    const auto number =
        parse_number<double>(std::string_view(text).substr(0, text.size() - (percent ? 1 : 0)));
    const double share = number.value_or(0) / (percent ? 100 : 1);
    if (!(share > 0 && share <= 1))
      refuse("--error", text, "a share above 0 up to 1, as 2% or 0.02");
    error = share;
  };
  CLI::Option* option = app.add_option_function<std::string>(
      "--error", set,
      "RMS error of occlusion and of light, each over its mean, against rays at the surfels, as 2% "
      "or 0.02: takes the\n"
      "cheapest settings that meet it at pilot receivers, or the finest, and says so, where none "
      "does [default: the\n"
      "expert settings]");
  option->type_name("SHARE")->group("Quality");
  for (const char* name : {"--solid-angle", "--parallax", "--inflation", "--resolution"}) {
    option->excludes(app.get_option(name));
  }
}

void add_estimate_option(CLI::App& app, bool& estimate) {
  app.add_flag("--estimate", estimate,
               "Also write what occlusion and irradiance are off at each receiver, as estimated: "
               "occlusion_error and\n"
               "irradiance_error. Wants --error or --check")
      ->group("Quality");
}

void add_tolerate_damage(CLI::App& app, bool& tolerate) {
  app.add_flag("--tolerate-damage", tolerate,
               "Go on where a page of the scene is damaged, with the cluster above it in its "
               "place, and tell how many and\n"
               "a bound on the error; points on such pages are left out [default: stop]");
}

void add_check_options(CLI::App& app, CheckRequest& check) {
  constexpr char kGroup[] = "Quality";
  add_integer(app, "--check", check.receivers, 0, 10'000'000,
              "Compare so many of the receivers with rays")
      ->group(kGroup);
  add_integer(app, "--check-rays", check.rays, 1, 1 << 24, "Rays for each of them")->group(kGroup);
}

}  // namespace ptc
