// From a mesh to the errors of its picture:
//
//   mesh --> container --> render_picture() ----> ours  --+
//     |                                                   +--> errors, FLIP, a sheet of pictures
//     `----> trace_paths() in two halves -------> paths --+
//
// The renderer and the path tracer take the same rays through each pixel, so that edges look alike
// and what differs is light.
#include "tools/bench/experiments/rooms.h"

#include <algorithm>
#include <cmath>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/procedural/city.h"
#include "tools/bench/chart/flip.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/report/sheet.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

/// Writes both pictures and the map of their differences as layers of one file.
void write_layers(const std::filesystem::path& path, const Image& ours, const Image& paths,
                  const std::vector<float>& errors) {
  const auto layer = [](const char* name, const Image& image) {
    ExrLayer colours{{name, ExrLayerType::Kind::colour, true}, {}};
    for (const glm::vec3& p : image.pixels)
      colours.values.insert(colours.values.end(), {p.x, p.y, p.z});
    return colours;
  };
  std::vector<ExrLayer> layers{layer("", ours), layer("paths", paths)};
  ExrLayer& flip = layers.emplace_back();
  flip.name = "flip";
  flip.kind = ExrLayerType::Kind::scalar;
  flip.values = errors;
  write_exr(path, ours.width, ours.height, layers);
}

}  // namespace

Image image_of(const PathPicture& paths, unsigned width, unsigned height) {
  Image image{width, height, {}};
  for (std::size_t i = 0; i < paths.a.size(); ++i) image.pixels.push_back(paths.at(i));
  return image;
}

float exposure_of(const Image& image) {
  std::vector<float> light;
  for (const glm::vec3& p : image.pixels) {
    if (const float most = std::max({p.x, p.y, p.z}); most > 0) light.push_back(most);
  }
  if (light.empty()) return 1;
  const auto ninth = light.begin() + static_cast<std::ptrdiff_t>(light.size() * 9 / 10);
  std::ranges::nth_element(light, ninth);
  return 0.9F / *ninth;
}

Image scaled(Image image, float factor) {
  for (glm::vec3& pixel : image.pixels) pixel *= factor;
  return image;
}

BuiltRoom build_room(const SceneChoice& choice, const RoomsOptions& options,
                     const std::filesystem::path& target, const RunOptions& run,
                     Progress& progress) {
  BuiltRoom room;
  auto [request, lit] = request_scene(choice, {.points = options.points}, run);
  std::vector<MeshCamera> cameras;
  const bool from_file = !choice.file.empty();
  if (from_file) {
    if (options.lights) request.lights = options.lights;
    Progress silent;  // the build reads the files again and reports what it leaves out
    room.mesh =
        load_meshes(request.inputs, nullptr, {.backdrop = choice.backdrop}, {}, silent).mesh;
    cameras = file_cameras(request.inputs);
  } else {
    room.mesh = choice.name == "city" ? city_mesh(options.points) : lit.mesh;
  }
  room.build_seconds = timed([&] { build_container(request, target, progress); }).wall;
  const ContainerReader container(target);
  room.surfels = container.superblock().points;
  room.lights = recorded_lights(container, run, target, progress);
  room.camera = from_file || choice.name == "city"
                    ? default_camera(container, cameras, {}, options.size)
                    : lit.camera;
  if (options.camera) room.camera = *options.camera;
  room.camera.width = options.size[0];
  room.camera.height = options.size[1];
  return room;
}

RoomRow compare_room(const Image& ours, const PathPicture& paths) {
  double sum = 0, difference = 0, square = 0, apart = 0, count = 0;
  for (std::size_t i = 0; i < ours.pixels.size(); ++i) {
    if (!paths.judged[i]) continue;
    for (int c = 0; c < 3; ++c) {
      const auto a = static_cast<double>(paths.a[i][c]), b = static_cast<double>(paths.b[i][c]),
                 o = static_cast<double>(ours.pixels[i][c]);
      sum += 0.5 * (a + b);
      difference += o - 0.5 * (a + b);
      // The errors of the halves are independent, so that those of the paths cancel
      square += (o - a) * (o - b);
      apart += (a - b) * (a - b);
      ++count;
    }
  }
  RoomRow row;
  row.judged = count / (3 * static_cast<double>(ours.pixels.size()));
  if (sum <= 0) return row;
  const double mean = sum / count;
  row.bias = difference / sum;
  row.rms = std::sqrt(std::max(0.0, square / count)) / mean;
  row.noise = std::sqrt(apart / count) / 2 / mean;
  return row;
}

Room measure_room(const SceneChoice& choice, const RoomsOptions& options,
                  const std::filesystem::path& work, const RunOptions& run, Progress& progress) {
  // Build the scene, and render it
  const WorkFile built(work, "-room.ptcx"), picture(work, "-room.exr");
  const BuiltRoom scene = build_room(choice, options, built.path(), run, progress);
  RenderRequest request{{.scene = built.path(), .bounces = options.bounces, .run = run}};
  request.mesh = std::make_shared<const Mesh>(scene.mesh);
  request.camera = scene.camera;
  request.samples = options.side * options.side;
  const PictureTarget target{.path = picture.path()};
  const Cost rendering = timed([&] { render_picture(request, {&target, 1}, progress); });
  const Image ours = read_image(picture.path());

  // Trace the paths
  const ThreadPool executor(run.threads);
  const RayScene rays(scene.mesh);
  PathPicture paths;
  const PathOptions tracing{options.paths, options.side, options.bounces + 1};
  const Cost tracing_cost = timed(
      [&] { paths = trace_paths(rays, scene.lights, scene.camera, tracing, executor, progress); });

  // Compare them
  const auto [width, height] = options.size;
  const Image truth = image_of(paths, width, height);
  const float exposure = exposure_of(truth);
  const Image shown = scaled(ours, exposure), shown_truth = scaled(truth, exposure);
  const std::vector<float> errors = hdr_flip(ours, truth);
  Room room{.row = compare_room(ours, paths),
            .sheet = side_by_side({shown, shown_truth, flip_map(errors, width, height)})};
  RoomRow& row = room.row;
  row.scene = choice.name;
  row.triangles = scene.mesh.triangles.size();
  row.surfels = scene.surfels;
  row.flip = mean_flip(shown, shown_truth);
  row.hdr_flip = mean_of(errors);
  row.noise_hdr_flip = mean_of(hdr_flip({width, height, paths.a}, Image{width, height, paths.b}));
  row.build_seconds = scene.build_seconds;
  row.render_seconds = rendering.wall;
  row.path_seconds = tracing_cost.wall;
  if (!options.pictures.empty()) {
    std::filesystem::create_directories(options.pictures);
    write_layers(options.pictures / (choice.name + ".exr"), ours, truth, errors);
  }
  return room;
}

}  // namespace ptc::bench
