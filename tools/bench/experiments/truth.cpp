// From a mesh to the errors of its pictures:
//
//   mesh --> container --> render_picture() for each number of bounces --> ours ---+
//     |                                                                            +--> errors
//     |--> scene.xml --> Mitsuba in Python, with two seeds --> two halves ---------+
//     `--> trace_paths(), where there is no Mitsuba ---------> two halves ---------+
#include "tools/bench/experiments/truth.h"

#include <limits>

#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "tools/bench/chart/flip.h"
#include "tools/bench/experiments/rival_run.h"
#include "tools/bench/references/mitsuba.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/report/sheet.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr unsigned kRaysAlong = 4;  // rays along the side of a pixel that tell what it shows

/// Says of each pixel whether all rays through it and its borders meet one surface that is smooth
/// and does not emit.
std::vector<char> pixels_of_one_surface(const RayScene& scene, const Camera& camera,
                                        const Executor& executor) {
  std::vector<char> judged(std::size_t{camera.width} * camera.height, 1);
  executor.for_each(camera.height, [&](std::size_t y, unsigned) {
    for (std::size_t x = 0; x < camera.width; ++x) {
      const auto hit_at = [&](unsigned i, unsigned j) {
        const auto along = [](std::size_t pixel, unsigned step) {
          return static_cast<float>(pixel) + static_cast<float>(step) / kRaysAlong;
        };
        return scene.closest(camera.position, camera.direction(along(x, i), along(y, j)), 0,
                             std::numeric_limits<double>::infinity());
      };
      const auto first = hit_at(0, 0);
      bool one = first.has_value();
      for (unsigned k = 0; one && k < (kRaysAlong + 1) * (kRaysAlong + 1); ++k) {
        const auto hit = hit_at(k % (kRaysAlong + 1), k / (kRaysAlong + 1));
        one = hit && hit->emission == glm::vec3(0) && hit->front &&
              glm::dot(hit->normal, first->normal) > 0.95F &&
              std::abs(glm::dot(hit->position - first->position,
                                glm::dvec3(first->geometric_normal))) < 0.02 * first->distance;
      }
      judged[y * camera.width + x] = one ? 1 : 0;
    }
  });
  return judged;
}

/// Renders pictures of one scene by the judge.
class TruthJudge {
 public:
  TruthJudge(const BuiltRoom& room, const TruthOptions& options, const std::filesystem::path& work,
             const RunOptions& run, Progress& progress)
      : room_(room),
        options_(options),
        directory_(work / ".ptcbench-mitsuba"),
        executor_(run.threads),
        rays_(room.mesh),
        judged_(pixels_of_one_surface(rays_, room.camera, executor_)),
        progress_(progress) {
    if (!options.python.empty())
      write_mitsuba_scene(directory_.path(), room.mesh, room.lights, room.camera);
  }

  /// Renders a picture. @param row  receives the judge's name and its time
  PathPicture render(unsigned bounces, TruthRow& row) {
    PathPicture picture;
    if (options_.python.empty()) {
      row.judge = "own paths";
      const PathOptions tracing{options_.room.paths, options_.room.side, bounces + 1};
      row.errors.path_seconds =
          timed([&] {
            picture = trace_paths(rays_, room_.lights, room_.camera, tracing, executor_, progress_);
          }).wall;
    } else {
      picture = by_mitsuba(bounces, row);
    }
    picture.judged = judged_;
    return picture;
  }

 private:
  PathPicture by_mitsuba(unsigned bounces, TruthRow& row) const {
    const std::filesystem::path &directory = directory_.path(), a = directory / "a.exr",
                                b = directory / "b.exr";
    const auto facts = run_python(options_.python, directory, mitsuba_program(),
                                  {directory / "scene.xml", a, b, std::to_string(bounces + 1),
                                   std::to_string((options_.room.paths + 1) / 2)},
                                  "Mitsuba");
    row.judge = "Mitsuba " + facts.at("version").get<std::string>();
    row.errors.path_seconds = facts.at("seconds").get<double>();
    return {read_image(a).pixels, read_image(b).pixels, {}};
  }

  const BuiltRoom& room_;
  const TruthOptions& options_;
  WorkDirectory directory_;
  ThreadPool executor_;
  RayScene rays_;
  std::vector<char> judged_;
  Progress& progress_;
};

}  // namespace

Truth measure_truth(const SceneChoice& choice, const TruthOptions& options,
                    const std::filesystem::path& work, const RunOptions& run, Progress& progress) {
  const WorkFile built(work, "-truth.ptcx"), rendered(work, "-truth.exr");
  const BuiltRoom room = build_room(choice, options.room, built.path(), run, progress);
  TruthJudge judge(room, options, work, run, progress);
  Truth truth{.scene = choice.name, .rows = {}, .sheet = {}};
  const auto [width, height] = options.room.size;
  for (const unsigned bounces : options.bounces) {
    // Render both pictures
    RenderRequest request{{.scene = built.path(), .bounces = bounces, .run = run}};
    request.mesh = std::make_shared<const Mesh>(room.mesh);
    request.camera = room.camera;
    request.samples = options.room.side * options.room.side;
    const PictureTarget target{.path = rendered.path()};
    const Cost rendering = timed([&] { render_picture(request, {&target, 1}, progress); });
    const Image ours = read_image(rendered.path());
    TruthRow row{.judge = {}, .bounces = bounces, .errors = {}};
    const PathPicture paths = judge.render(bounces, row);
    const double judge_seconds = row.errors.path_seconds;
    // Compare them
    const Image theirs = image_of(paths, width, height);
    const float exposure = exposure_of(theirs);
    const Image shown = scaled(ours, exposure), shown_theirs = scaled(theirs, exposure);
    const std::vector<float> differences = hdr_flip(ours, theirs);
    row.errors = compare_room(ours, paths);
    row.errors.scene = choice.name;
    row.errors.surfels = room.surfels;
    row.errors.triangles = room.mesh.triangles.size();
    row.errors.flip = mean_flip(shown, shown_theirs);
    row.errors.hdr_flip = mean_of(differences);
    row.errors.noise_hdr_flip =
        mean_of(hdr_flip({width, height, paths.a}, Image{width, height, paths.b}));
    row.errors.build_seconds = room.build_seconds;
    row.errors.render_seconds = rendering.wall;
    row.errors.path_seconds = judge_seconds;
    truth.rows.push_back(row);
    truth.sheet = side_by_side({shown, shown_theirs, flip_map(differences, width, height)});
  }
  return truth;
}

}  // namespace ptc::bench
