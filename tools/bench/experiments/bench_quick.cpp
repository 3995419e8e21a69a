#include "tools/bench/experiments/bench_quick.h"

#include <utility>

namespace ptc::bench {
namespace {

/// A value, unless the option that sets it was given.
template <class Value, class Quick>
void set_unless_given(const CLI::App& command, const char* option, Value& value, Quick&& quick) {
  if (command.count(option) == 0) value = std::forward<Quick>(quick);
}

/// Of sort and build.
template <class Options>
void shorten_records(Options& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.points,
                   std::vector<std::uint64_t>{200'000, 1'000'000});
  set_unless_given(command, "--repeats", options.repeats, 3U);
}

}  // namespace

void shorten(AccuracyOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.scene.points, 200'000U);
  set_unless_given(command, "--checked", options.checked, 200U);
  set_unless_given(command, "--repeats", options.repeats, 3U);
  options.scene.shaded_width =
      192;  // in the middle: as dense as the whole picture, or less would be shared
  options.scene.shaded_height = 108;
  options.scene.window_width = 48;
  options.scene.window_height = 27;
  options.scene.own_points = 8'192;
  options.rays = {64, 256, 1024, 4096};
  options.plain_solid_angles = {0.01F};
  const std::vector<GatherOptions> all = AccuracyOptions::default_settings();
  set_unless_given(command, "--setting", options.settings,
                   std::vector<GatherOptions>{all[0], all[2], all[3], all[5]});
}

void shorten(BuildBenchOptions& options, const CLI::App& command) {
  shorten_records(options, command);
  set_unless_given(command, "--cap", options.caps,
                   std::vector<std::uint64_t>{std::uint64_t{96} << 20, std::uint64_t{192} << 20});
}

void shorten(CacheBenchOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.points, 1'000'000U);
  set_unless_given(command, "--receivers", options.receivers, 8'192U);
  set_unless_given(command, "--repeats", options.repeats, 2U);
  options.caps = {1, 0.29, 0.09};
  options.threads = {1, 2, 4};
}

void shorten(ErrorOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.scene.points, 50'000U);
  set_unless_given(command, "--checked", options.checked, 400U);
  options.scene.width = 320;
  options.scene.height = 180;
}

void shorten(GrowthOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.points,
                   std::vector<std::uint64_t>{50'000, 150'000, 500'000});
  set_unless_given(command, "--checked", options.checked, 100U);
  set_unless_given(command, "--repeats", options.repeats, 3U);
  options.middle_points = 50'000;
  options.solid_angles = {0.1F, 0.01F, 0.001F};
  options.layers = {1, 4, 16};
  options.caps = {1, 0.29, 0.09};  // less of so few pages is nothing
  options.own_points = 8'192;
  options.reference_rays = 4096;
}

void shorten(ModelOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.scene.points, 100'000U);
  set_unless_given(command, "--checked", options.checked, 150U);
  set_unless_given(command, "--repeats", options.repeats, 2U);
  options.scene.shaded_width = 192;
  options.scene.shaded_height = 108;
  options.reference_rays = 4096;
}

void shorten(ScaleOptions& options, const CLI::App& command) {
  set_unless_given(command, "--points", options.points,
                   std::vector<std::uint64_t>{200'000, 1'000'000});
  set_unless_given(command, "--receivers", options.receivers, 8'000U);
  set_unless_given(command, "--repeats", options.repeats, 2U);
}

void shorten(SortBenchOptions& options, const CLI::App& command) {
  shorten_records(options, command);
}

}  // namespace ptc::bench
