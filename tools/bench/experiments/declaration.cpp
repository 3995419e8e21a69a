#include "tools/bench/experiments/declaration.h"

#include <algorithm>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "engine/base/error.h"
#include "engine/base/numbers.h"
#include "engine/pipeline/point_input.h"
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
constexpr char kScenes[] =
    "fractal, window, city, cornell, box-lamp, ajar, or files of meshes and clouds";

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
    if (scene.file.empty()) {
      if (joined_)
        throw RequestError("scenes", scene.name + ": only files can be joined to one scene");
      continue;
    }
    if (!std::filesystem::exists(scene.file)) {
      throw DataError(scene.file.string() + ": No such file or directory; scenes are " + kScenes);
    }
    check_input(scene.file);
  }
  if (!joined_) return;
  // Keep the first scene, and give it the files of the others
  for (std::size_t i = 1; i < choices_.size(); ++i)
    choices_.front().more.push_back(choices_[i].file);
  choices_.resize(1);
}

void SceneList::check_meshes() {
  check();
  for (const SceneChoice& scene : choices_) {
    if (scene.file.empty()) continue;
    std::vector<std::filesystem::path> files = scene.more;
    files.push_back(scene.file);
    for (const std::filesystem::path& file : files) {
      if (holds_points(file))
        throw DataError(file.string() + ": has no triangles from which points could be drawn");
    }
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
                       "[default: " +
                       join(scenes.texts_, " ") + "; " + scenes.texts_.front() + " with --quick]")
      ->type_name("SCENE");
  quick("scenes", scenes.texts_, {scenes.texts_.front()});
}

void Declaration::joinable(SceneList& scenes) {
  command_->add_flag_callback(
      "--join", [&scenes] { scenes.join(); }, "Take all files as one scene, as ptcbuild does");
}

void Declaration::count(const char* name, std::uint64_t& value, const char* description,
                        const char* shown) {
  add_count(*command_, name, value, description)->default_str(shown);
}

void Declaration::integer(const char* name, unsigned& value, std::uint64_t least,
                          std::uint64_t most, const char* description) {
  add_integer(*command_, name, value, least, most, description);
}

void Declaration::integer(const char* name, std::uint64_t& value, std::uint64_t least,
                          std::uint64_t most, const char* description) {
  add_integer(*command_, name, value, least, most, description);
}

void Declaration::number(const char* name, const char* unit, float& value, double least,
                         double most, const char* description) {
  add_number(*command_, name, value, least, most, description)->type_name(unit);
}

void Declaration::file(const char* name, std::filesystem::path& value, const char* description) {
  command_->add_option(name, value, description)->type_name("FILE");
}

void Declaration::files(std::vector<std::filesystem::path>& values, const char* description) {
  command_->add_option("files", values, description)->type_name("FILE")->check(CLI::ExistingFile);
}

void Declaration::points(std::uint64_t& points, const char* shown, std::uint64_t less) {
  count("--points", points, "Surfels wanted of a mesh or the city; k, M, G count by 1000", shown);
  quick("--points", points, less);
}

void Declaration::city_points(std::uint64_t& points, const char* shown, std::uint64_t less) {
  count("--points", points, "Points of the city", shown);
  quick("--points", points, less);
}

void Declaration::block_receivers(std::uint64_t& receivers, const char* shown, std::uint64_t less) {
  count("--receivers", receivers, "Receivers among these points, in blocks of neighbours", shown);
  quick("--receivers", receivers, less);
}

void Declaration::points(std::vector<std::uint64_t>& points, const char* description,
                         std::vector<std::uint64_t> less) {
  const auto parse = [](const std::string& text) { return parse_count("--points", text); };
  list("--points", "COUNT", points, parse, description);
  quick("--points", points, std::move(less));
}

void Declaration::checked(unsigned& checked, unsigned less) {
  integer("--checked", checked, 10, 1'000'000, "Receivers whose error is measured, of each set");
  quick("--checked", checked, less);
}

void Declaration::repeats(unsigned& repeats, unsigned less) {
  integer("--repeats", repeats, 1, 1000, "Runs of each measurement");
  quick("--repeats", repeats, less);
}

void Declaration::words(const char* name, std::vector<std::string>& chosen,
                        const char* description) {
  const std::string text = std::string(description) + " (" + join(chosen, "|") + ")";
  offer(command_->add_option(name, chosen, text), chosen)
      ->type_name("NAME")
      ->allow_extra_args(false)
      ->check(one_of(chosen));
}

void Declaration::for_experts(const char* name) {
  command_->get_option(name)->group(kExpertGroup);
}

bool Declaration::is_given(const CLI::App& command, const std::string& option) {
  return !option.empty() && command.count(option) > 0;
}

void Declaration::repeatable(const char* name, const char* type,
                             const std::function<void(const std::vector<std::string>&)>& set,
                             const char* description) {
  command_->add_option_function<std::vector<std::string>>(name, set, description)
      ->type_name(type)
      ->allow_extra_args(false);
}

}  // namespace ptc::bench
