// The experiment `ptcbench specks`: its table columns and its options.
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/specks.h"

namespace ptc::bench {
namespace {

constexpr char kSpecksReading[] =
    "Points drawn at random from a mesh, without normals and radii, are built and shaded as "
    "ptcshade "
    "does by default. Their occlusion is compared with that of rays at the mesh, from the place "
    "where "
    "each point was drawn, on the side of its triangle's normal. A speck is a point whose "
    "occlusion "
    "is off by more than 0.3. Noise is Gaussian along each axis, in spacings sqrt(area / points). "
    "Holes are balls of four spacings without points. The density falls along x. Two "
    "pictures of the points, of the whole scene and of its middle at a fourth of the angle, are "
    "compared "
    "with pictures of the mesh: holes are pixels inside its silhouette that show the background or "
    "a "
    "farther surface. Wall times are of one run.";

const Columns<SpecksRow>& specks_columns() {
  using R = SpecksRow;
  static const Columns<R> columns{{"scene", {"scene"}, &R::scene},
                                  {"cloud", {"cloud"}, &R::cloud},
                                  {"points", {"points"}, &R::points},
                                  {"checked", {"checked"}, &R::checked},
                                  {"rms", {"occlusion RMS", "{:.4f}"}, &R::rms},
                                  {"mean", {"mean error", "{:+.4f}"}, &R::mean},
                                  {"specks", percent("specks %", "{:.2f}"), &R::specks},
                                  {"holes", percent("holes %", "{:.3f}"), &R::holes},
                                  {"picture_rms", {"pictures, RMS", "{:.4f}"}, &R::picture_rms},
                                  {"build_us", {"build us/point", "{:.2f}"}, &R::build_us},
                                  {"shade_us", {"shade us/point", "{:.2f}"}, &R::shade_us}};
  return columns;
}

}  // namespace

Report report_of(const std::vector<std::vector<SpecksRow>>& scenes, unsigned runs) {
  std::vector<SpecksRow> rows;
  for (const auto& scene : scenes) rows.insert(rows.end(), scene.begin(), scene.end());
  return {.name = "specks",
          .title = "Occlusion at the points of scans",
          .reading = kSpecksReading,
          .runs = runs,
          .tables = {tabulate<SpecksRow>({.name = "rows"}, specks_columns(), rows)}};
}

Experiment make_specks_experiment() {
  const auto options = std::make_shared<SpecksOptions>();
  const auto scenes = std::make_shared<SceneList>();
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->points, "300k", 20'000);
    d.checked(options->checked, 200);
    d.number("--lift", "RADII", options->lift, 0, 100,
             "Height of receivers over their surfels, in radii");
  };
  const auto run = [=](const Bench& b) {
    return measure_scenes(*scenes, 1, b, [&](const SceneChoice& choice) {
      return measure_specks(choice, *options, b.work, b.run, b.progress);
    });
  };
  return {.name = "specks",
          .purpose = "Errors of occlusion at the points of scans that were drawn from meshes",
          .quick = "20k points of the first scene, 200 checked",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check_meshes(); }};
}

}  // namespace ptc::bench
