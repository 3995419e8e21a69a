// The experiment `ptcbench demo`: what a user waits for. The work of each program on a scene, one
// after the other, and the error of the picture:
//
//   input -> build -> .ptcx -+-> verify
//                            +-> shade -> .ply        with one bounce, and without
//                            `-> render -> .exr -> check against rays (not timed)
#include <algorithm>
#include <array>
#include <optional>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/verify/verify.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr char kDemoReading[] =
    "The work of ptcbuild, ptcverify, ptcshade and ptcrender on a scene under one memory cap, done "
    "by one process: reading the inputs, everything between, and writing the outputs. Peak memory "
    "is the maximum of resident memory of the whole program during a stage. Gather CPU is the time "
    "of the gather alone. Errors are "
    "the root mean square (RMS) and the mean (bias) of the difference between some of the "
    "picture's receivers and rays, at the same surfels and at the mesh, without the error of the "
    "rays themselves; those of irradiance are shares of its mean.";

constexpr std::uint64_t kCheckBytes = std::uint64_t{4} << 30;  ///< cap of the check against rays

constexpr std::array kStages{"build", "verify", "shade", "shade, no bounce", "render"};

/// What `ptcbench demo` measures.
struct DemoOptions {
  SceneOptions scene;
  std::uint64_t receivers = 0;  ///< points that each shading shades; 0: all
  std::vector<std::string> stages{kStages.begin(), kStages.end()};
  std::array<unsigned, 2> size{960, 540};  ///< pixels of the picture
  unsigned samples = 4;                    ///< samples per pixel, a square number
  unsigned checked = 2000;                 ///< receivers whose error is measured
  unsigned check_rays = 4096;              ///< rays per checked receiver
  unsigned repeats = 5;

  [[nodiscard]] bool has(std::string_view stage) const {
    return std::ranges::find(stages, stage) != stages.end();
  }
};

/// One stage of one scene. Counts are those of the last run.
struct DemoRow {
  std::string scene, stage;
  std::uint64_t memory_bytes = 0;
  unsigned threads = 0;
  Spread wall, cpu;                  ///< seconds
  std::uint64_t resident_bytes = 0;  ///< maximum of the whole program during a run
  std::uint64_t points = 0, nodes = 0, file_bytes = 0;
  std::optional<LightingReport> shaded;
};

/// The error of the picture against rays at one model.
struct DemoError {
  std::string scene, against;
  std::size_t receivers = 0;
  unsigned rays = 0;
  CheckError error;
  double ray_us = 0;  ///< CPU time of the rays, per receiver
};

/// Everything that was measured on one scene.
struct SceneDemo {
  std::vector<DemoRow> rows;
  std::vector<DemoError> errors;
};

const Columns<DemoRow>& demo_columns() {
  using R = DemoRow;
  const auto shaded = [](auto value) {
    return [value](const R& r) { return r.shaded ? value_of(value(*r.shaded)) : Value(); };
  };
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"stage", {"stage"}, &R::stage},
      {"memory_bytes", {"cap MiB", "{:.0f}", kMebi}, &R::memory_bytes},
      {"threads", {"threads"}, &R::threads},
      {"wall_seconds", {"wall s", "{:.2f}"}, &R::wall},
      {"cpu_seconds", {"CPU s", "{:.2f}"}, &R::cpu},
      {"resident_bytes", {"peak memory MiB", "{:.0f}", kMebi}, &R::resident_bytes},
      {"points", {"surfels"}, &R::points},
      {"nodes", {"nodes"}, &R::nodes},
      {"file_bytes", {"file MiB", "{:.1f}", kMebi}, &R::file_bytes},
      {"receivers", {"receivers"}, shaded([](const LightingReport& s) { return s.receivers; })},
      {"us_per_receiver", {"gather CPU us/receiver", "{:.1f}"}, shaded([](const LightingReport& s) {
         return 1e6 * s.shade_cpu_seconds /
                static_cast<double>(std::max<std::uint64_t>(1, s.receivers));
       })},
      {"hit_rate", percent("cache hits %", "{:.3f}"),
       shaded([](const LightingReport& s) { return s.cache.hit_rate(); })},
      {"read_bytes", {"cache read MiB", "{:.0f}", kMebi}, shaded([](const LightingReport& s) {
         return s.cache.bytes_read;
       })}};
  return columns;
}

const Columns<DemoError>& demo_error_columns() {
  using R = DemoError;
  const auto error = [](auto member) { return path(&R::error, member); };
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"against", {"rays at"}, &R::against},
      {"receivers", {"receivers"}, &R::receivers},
      {"rays", {"rays/receiver"}, &R::rays},
      {"occlusion_mean", {"mean occlusion", "{:.3f}"}, error(&CheckError::occlusion_mean)},
      {"occlusion_rms", {"occlusion RMS", "{:.4f}"}, error(&CheckError::occlusion_rms)},
      {"occlusion_bias", {"occlusion bias", "{:+.4f}"}, error(&CheckError::occlusion_bias)},
      {"irradiance_rms", percent("irradiance RMS %"), error(&CheckError::irradiance_rms)},
      {"irradiance_bias", percent("irradiance bias %", "{:+.2f}"),
       error(&CheckError::irradiance_bias)},
      {"ray_us_per_receiver", {"CPU us of the rays/receiver", "{:.0f}"}, &R::ray_us}};
  return columns;
}

/// Runs all stages of one scene in turn.
class DemoRun {
 public:
  DemoRun(const SceneChoice& choice, const DemoOptions& options, const Bench& bench)
      : choice_(choice),
        options_(options),
        bench_(bench),
        request_(request_scene(choice, options.scene, bench.run)),
        container_(bench.work, ".ptcx"),
        shaded_(bench.work, ".ply"),
        picture_(bench.work, ".exr") {}

  SceneDemo measure() {
    bench_.progress.begin(choice_.name, options_.repeats * kStages.size(), "stages");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (std::size_t stage = 0; stage < kStages.size(); ++stage) {
        if (stage == 0 || options_.has(kStages[stage])) run(stage);
        bench_.progress.advance(1);
      }
    }
    bench_.progress.end();
    SceneDemo demo;
    for (std::size_t stage = 0; stage < kStages.size(); ++stage) {
      if (options_.has(kStages[stage])) demo.rows.push_back(row(stage));
    }
    if (options_.checked > 0 && options_.has("render")) check(demo.errors);
    return demo;
  }

 private:
  /// Runs and times one stage, an index into kStages.
  void run(std::size_t stage) {
    Progress silent;
    times_[stage].run([&] {
      switch (stage) {
        case 0:
          built_ = build_container(request_.build, container_.path(), silent).superblock;
          break;
        case 1:
          verify();
          break;
        case 2:
        case 3:
          reports_[stage] = shade(stage == 2 ? 1 : 0);
          break;
        default:
          reports_[stage] = render(render_request());
      }
    });
  }

  void verify() const {
    Progress silent;
    const VerifyReport report = verify_container(
        container_.path(), {.memory_bytes = bench_.run.memory_bytes, .threads = bench_.run.threads},
        silent);
    if (!report.sound()) throw DataError(choice_.name + ": the container is not sound");
  }

  [[nodiscard]] LightingReport shade(unsigned bounces) const {
    Progress silent;
    ShadeRequest request{{.scene = container_.path(), .bounces = bounces, .run = bench_.run}};
    request.count = options_.receivers;
    return shade_container(request, shaded_.path(), silent);
  }

  [[nodiscard]] RenderRequest render_request() const {
    RenderRequest request{{.scene = container_.path(), .run = bench_.run}};
    request.meshes = request_.build.inputs;
    request.mesh = request_.build.mesh;
    request.backdrop = choice_.backdrop;
    request.size = options_.size;
    request.samples = options_.samples;
    if (request.mesh) request.camera = request_.lit.camera;
    return request;
  }

  [[nodiscard]] LightingReport render(const RenderRequest& request) const {
    Progress silent;
    const PictureTarget target{.path = picture_.path()};
    return render_picture(request, {&target, 1}, silent);
  }

  [[nodiscard]] DemoRow row(std::size_t stage) const {
    return {.scene = choice_.name,
            .stage = kStages[stage],
            .memory_bytes = bench_.run.memory_bytes,
            .threads = ThreadPool(bench_.run.threads).threads(),
            .wall = spread_of(times_[stage].wall),
            .cpu = spread_of(times_[stage].cpu),
            .resident_bytes = times_[stage].peak,
            .points = built_.points,
            .nodes = built_.nodes,
            .file_bytes = built_.file_bytes,
            .shaded = reports_[stage]};
  }

  /// Compares a picture of half the size with rays. The memory cap is raised so that the rays have
  /// room for all surfels at once.
  void check(std::vector<DemoError>& errors) const {
    RenderRequest request = render_request();
    request.size = {std::max(1U, options_.size[0] / 2), std::max(1U, options_.size[1] / 2)};
    request.samples = 1;
    request.run.memory_bytes = std::max(bench_.run.memory_bytes, kCheckBytes);
    request.check = {.receivers = options_.checked, .rays = options_.check_rays};
    const CheckReport report = *render(request).check;
    const auto add = [&](const char* against, const CheckError& error, double ray_us) {
      errors.push_back({.scene = choice_.name,
                        .against = against,
                        .receivers = report.receivers,
                        .rays = report.rays,
                        .error = error,
                        .ray_us = ray_us});
    };
    add("the same surfels", report.discs, report.disc_microseconds);
    if (report.mesh) add("the mesh", *report.mesh, report.mesh_microseconds);
  }

  const SceneChoice& choice_;
  const DemoOptions& options_;
  const Bench& bench_;
  SceneRequest request_;
  WorkFile container_, shaded_, picture_;
  Superblock built_;
  std::array<TimedRuns, kStages.size()> times_;
  std::array<std::optional<LightingReport>, kStages.size()> reports_;
};

Report report_of(const std::vector<SceneDemo>& scenes, unsigned runs) {
  std::vector<DemoRow> rows;
  std::vector<DemoError> errors;
  for (const SceneDemo& scene : scenes) {
    rows.insert(rows.end(), scene.rows.begin(), scene.rows.end());
    errors.insert(errors.end(), scene.errors.begin(), scene.errors.end());
  }
  return {.name = "demo",
          .title = "Time and memory from input to picture, and the error of the picture",
          .reading = kDemoReading,
          .runs = runs,
          .tables = {
              tabulate<DemoRow>({.name = "rows", .title = "Scene", .group = "scene"},
                                demo_columns(), rows),
              tabulate<DemoError>({.name = "errors", .title = "Error of the picture against rays"},
                                  demo_error_columns(), errors)}};
}

}  // namespace

Experiment make_demo_experiment() {
  const auto options = std::make_shared<DemoOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->scene.points, "2M", 50'000);
    d.count("--receivers", options->receivers,
            "Shade this many of the points, spread evenly [default: all]", "");
    d.words("--stage", options->stages, "Measure only this stage; repeatable");
    d.checked(options->checked, 200);
    d.repeats(options->repeats, 2);
    d.quick(options->size, {192, 108});
    d.quick(options->samples, 1);
    d.quick(options->check_rays, 1024);
  };
  const auto run = [=](const Bench& bench) {
    return measure_scenes(*scenes, options->repeats, bench, [&](const SceneChoice& choice) {
      return DemoRun(choice, *options, bench).measure();
    });
  };
  return {
      .name = "demo",
      .purpose =
          "From input to picture: time and memory of build, verification, shading and rendering, "
          "and the error of the picture against rays",
      .quick = "A few seconds: 50k points, a picture of 192 x 108, 200 receivers checked, 2 runs",
      .declare = declare,
      .run = run,
      .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
