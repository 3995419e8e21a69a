#include "tools/bench/experiments/declaration.h"

#include <algorithm>
#include <filesystem>

#include "engine/base/error.h"
#include "engine/base/numbers.h"
#include "tools/common.h"
#include "tools/option_text.h"
#include "tools/values.h"

namespace ptc::bench {
namespace {

/// Refuses any word but these.
CLI::Validator one_of(const std::vector<std::string>& known) {
  const auto check = [known](const std::string& text) {
    const bool found = std::ranges::find(known, text) != known.end();
    return found ? std::string() : "expects " + join(known, "|") + ", not '" + text + "'";
  };
  return {check, ""};
}

/// The scenes that can be named, for the help and for errors.
constexpr char kScenes[] = "fractal, window, city, or files of meshes and clouds";

}  // namespace

GatherOptions parse_setting(const std::string& text) {
  constexpr char kExpected[] =
      "SR,RAD,R or SR,RAD,R,X: a solid angle from 1e-6 to 4 pi, a parallax from 0 to pi, "
      "16, 32, 48 or 64 pixels along a cube edge, an inflation from 0.01 to 100";
  const std::vector<double> n = parse_numbers("--setting", text, {3, 4}, kExpected);
  const bool pixels = n[2] == 16 || n[2] == 32 || n[2] == 48 || n[2] == 64;
  GatherOptions options{.solid_angle = static_cast<float>(n[0]),
                        .parallax = static_cast<float>(n[1]),
                        .resolution = static_cast<unsigned>(n[2])};
  if (n.size() > 3) options.inflation = static_cast<float>(n[3]);
  if (n[0] < 1e-6 || n[0] > 4 * kPiDouble || n[1] < 0 || n[1] > kPiDouble || !pixels ||
      options.inflation < 0.01F || options.inflation > 100) {
    refuse("--setting", text, kExpected);
  }
  return options;
}

void SceneList::check() {
  choices_ = parse_scenes(texts_);
  for (const SceneChoice& scene : choices_) {
    if (scene.file.empty()) continue;
    if (!std::filesystem::exists(scene.file)) {
      throw DataError(scene.file.string() + ": No such file or directory; scenes are " + kScenes);
    }
    check_input(scene.file);
  }
}

void Declaration::shorten() const {
  for (const auto& set : quick_) set();
}

void Declaration::scenes(SceneList& scenes) {
  command_
      ->add_option("scenes", scenes.texts_,
                   std::string(kScenes) +
                       "; +backdrop after a mesh's name sets it on a ground before a wall "
                       "[default: fractal window city, fractal with --quick]")
      ->type_name("SCENE");
  quick("scenes", scenes.texts_, {scenes.texts_.front()});
}

void Declaration::count(const char* name, std::uint64_t& value, const char* description,
                        const char* shown, std::uint64_t less) {
  add_count(*command_, name, value, description)->default_str(shown);
  quick(name, value, less);
}

void Declaration::points(std::uint64_t& points, const char* shown, std::uint64_t less) {
  count("--points", points, "Surfels wanted of a mesh or the city; k, M, G count by 1000", shown,
        less);
}

void Declaration::city_points(std::uint64_t& points, const char* shown, std::uint64_t less) {
  count("--points", points, "Points of the city", shown, less);
}

void Declaration::block_receivers(std::uint64_t& receivers, const char* shown, std::uint64_t less) {
  count("--receivers", receivers, "Receivers among these points, in blocks of neighbours", shown,
        less);
}

void Declaration::points(std::vector<std::uint64_t>& points, const std::string& description,
                         std::vector<std::uint64_t> less) {
  const auto parse = [](const std::string& text) { return parse_count("--points", text); };
  list("--points", "COUNT", points, parse, description);
  quick("--points", points, std::move(less));
}

void Declaration::checked(unsigned& checked, unsigned less) {
  add_integer(*command_, "--checked", checked, 10, 1'000'000,
              "Receivers whose error is measured, of each set");
  quick("--checked", checked, less);
}

void Declaration::repeats(unsigned& repeats, unsigned less) {
  add_integer(*command_, "--repeats", repeats, 1, 1000, "Runs of each measurement");
  quick("--repeats", repeats, less);
}

CLI::Option* Declaration::words(const char* name, std::vector<std::string>& chosen,
                                const char* description) {
  const std::string text = std::string(description) + " (" + join(chosen, "|") + ")";
  return offer(command_->add_option(name, chosen, text), chosen)
      ->type_name("NAME")
      ->allow_extra_args(false)
      ->check(one_of(chosen));
}

}  // namespace ptc::bench
