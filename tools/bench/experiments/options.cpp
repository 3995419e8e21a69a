#include "tools/bench/experiments/options.h"

#include <algorithm>
#include <numbers>

#include "engine/base/numbers.h"
#include "tools/values.h"

namespace ptc::bench {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : "|") + word;
  return text;
}

/// Refuses what is none of these words.
CLI::Validator one_of(const std::vector<std::string>& known) {
  const auto check = [known](const std::string& text) {
    const bool found = std::ranges::find(known, text) != known.end();
    return found ? std::string() : "expects " + joined(known) + ", not '" + text + "'";
  };
  return {check, ""};
}

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

CLI::Option* add_words(CLI::App& command, const char* name, std::vector<std::string>& chosen,
                       const char* description) {
  return command.add_option(name, chosen, description)
      ->type_name(joined(chosen))
      ->allow_extra_args(false)
      ->check(one_of(chosen));
}

void add_points_list(CLI::App& command, std::vector<std::uint64_t>& points,
                     const char* description) {
  const auto set = [&points](const std::vector<std::string>& values) {
    points.clear();
    for (const std::string& text : values) points.push_back(parse_count("--points", text));
    std::ranges::sort(points);
  };
  command.add_option_function<std::vector<std::string>>("--points", set, description)
      ->type_name("COUNT")
      ->allow_extra_args(false);
}

}  // namespace ptc::bench
