// Container to picture (engine/pipeline/pipeline.h).
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>

#include <glm/geometric.hpp>

#include "engine/base/memory.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/light/bounces.h"
#include "engine/pipeline/pipeline.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/tuning.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/stages.h"
#include "engine/shade/shader.h"

namespace ptc {
namespace {

constexpr unsigned kTileSide = 256;  // pixels
constexpr std::uint64_t kReceiverBytes =
    320;  // of one pixel of a tile: hit, receiver, result, order
constexpr std::uint64_t kEstimateBytes =
    sizeof(Shading) + sizeof(ErrorEstimate);  // more, with estimates
constexpr unsigned kMostVariants = 16;

/// Sums over the samples of every pixel.
struct Film {
  unsigned width, height;
  std::vector<glm::vec3> beauty, direct, indirect, bent_normal, albedo;
  std::vector<float> occlusion, alpha;
  std::vector<float> occlusion_error,
      irradiance_error;  // squares until finish(); empty without estimates

  Film(unsigned w, unsigned h, bool estimates) : width(w), height(h) {
    const std::size_t pixels = std::size_t{w} * h;
    for (auto* layer : {&beauty, &direct, &indirect, &bent_normal, &albedo})
      layer->resize(pixels, glm::vec3(0));
    for (auto* layer : {&occlusion, &alpha}) layer->resize(pixels, 0);
    if (!estimates) return;
    for (auto* layer : {&occlusion_error, &irradiance_error}) layer->resize(pixels, 0);
  }

  static constexpr std::uint64_t kBytes = 5 * sizeof(glm::vec3) + 2 * sizeof(float);
  static constexpr std::uint64_t kEstimateBytes = 2 * sizeof(float);  // of a pixel more

  void add(std::size_t pixel, const PrimaryHit& hit, const Shading& s, float weight) {
    const glm::vec3 reflect = hit.albedo * std::numbers::inv_pi_v<float>;
    const glm::vec3 lit = hit.direct + (hit.sky_included ? glm::vec3(0) : reflect * s.sky);
    const glm::vec3 bounced = reflect * s.irradiance;
    direct[pixel] += weight * lit;
    indirect[pixel] += weight * bounced;
    beauty[pixel] += weight * (lit + bounced);
    bent_normal[pixel] += weight * s.bent_normal;
    albedo[pixel] += weight * hit.albedo;
    occlusion[pixel] += weight * s.occlusion;
    alpha[pixel] += weight;
  }

  void add(std::size_t pixel, const ErrorEstimate& estimate, float weight) {
    occlusion_error[pixel] += weight * estimate.occlusion * estimate.occlusion;
    irradiance_error[pixel] += weight * estimate.irradiance * estimate.irradiance;
  }

  void finish() {
    for (auto* layer : {&occlusion_error, &irradiance_error}) {
      for (float& value : *layer) value = std::sqrt(value);
    }
  }
};

std::vector<float> flatten(const std::vector<glm::vec3>& values) {
  std::vector<float> flat;
  flat.reserve(values.size() * 3);
  for (const glm::vec3& v : values) flat.insert(flat.end(), {v.x, v.y, v.z});
  return flat;
}

void write_layers(const std::filesystem::path& target, const Film& film) {
  using Kind = ExrLayer::Kind;
  std::vector<ExrLayer> layers{{"", Kind::colour, false, flatten(film.beauty)},
                               {"direct", Kind::colour, false, flatten(film.direct)},
                               {"indirect", Kind::colour, false, flatten(film.indirect)},
                               {"albedo", Kind::colour, false, flatten(film.albedo)},
                               {"occlusion", Kind::scalar, false, film.occlusion},
                               {"alpha", Kind::scalar, false, film.alpha},
                               {"bent_normal", Kind::vector, true, flatten(film.bent_normal)}};
  if (!film.occlusion_error.empty()) {
    layers.push_back({"occlusion_error", Kind::scalar, true, film.occlusion_error});
    layers.push_back({"irradiance_error", Kind::scalar, true, film.irradiance_error});
  }
  write_exr(target, film.width, film.height, layers);
}

void write_layer_png(const PictureTarget& target, const Film& film, float exposure) {
  Image image{.width = film.width, .height = film.height};
  if (target.layer == "occlusion") {
    for (std::size_t i = 0; i < film.occlusion.size(); ++i)
      image.pixels.emplace_back(1 - film.occlusion[i]);
  } else {
    image.pixels = target.layer == "direct"     ? film.direct
                   : target.layer == "indirect" ? film.indirect
                   : target.layer == "albedo"   ? film.albedo
                                                : film.beauty;
    const float gain = target.layer == "albedo" ? 1 : std::exp2(exposure);
    for (glm::vec3& pixel : image.pixels) pixel *= gain;
  }
  write_png(target.path, image);
}

void write_targets(std::span<const PictureTarget> targets, const Film& film, float exposure) {
  for (const PictureTarget& target : targets) {
    if (target.path.extension() == ".exr") {
      write_layers(target.path, film);
    } else {
      write_layer_png(target, film, exposure);
    }
  }
}

/// What the camera sees and what lights it, alive as long as the view.
struct Subject {
  Mesh mesh;
  std::unique_ptr<RayScene> rays;
  std::unique_ptr<DirectLight> light;
  std::unique_ptr<PrimaryView> view;
};

/// Makes the rays of a subject that has a mesh.
void view_mesh_of(Subject& subject, const RenderRequest& request, const ContainerReader& scene,
                  const LightRig& lights, const Camera& camera, unsigned side) {
  const double surfel_radius = surfel_spacing(scene) / std::numbers::sqrt2;
  subject.rays = std::make_unique<RayScene>(subject.mesh);
  subject.light = std::make_unique<DirectLight>(*subject.rays, lights);
  return_freed_memory();  // what reading the file and building the tree took
  subject.view = view_mesh(*subject.rays, *subject.light, request.light_sampling, camera, side,
                           request.lift * static_cast<float>(surfel_radius));
}

Receiver receiver_at(const PrimaryHit& hit) {
  return {hit.position + glm::dvec3(hit.offset_normal * hit.lift), hit.normal};
}

/// Samples lie on a grid of side x side in every pixel.
std::array<unsigned, 2> sample_at(unsigned x, unsigned y, unsigned sample, unsigned side) {
  return {x * side + sample % side, y * side + sample / side};
}

/// Windows of samples that stand for a picture's, where they see something.
std::vector<Pilot> pilots_of(const PrimaryView& view, const Camera& camera, unsigned side,
                             const Executor& executor) {
  constexpr double kGolden[2] = {0.7548776662466927,
                                 0.5698402909980532};  // plane covered evenly (Roberts 2018)
  constexpr std::uint64_t kWidth = 16;
  const PilotPlan plan = plan_pilots(std::uint64_t{camera.width} * camera.height * side * side);
  const auto width =
      static_cast<unsigned>(std::min<std::uint64_t>({kWidth, camera.width, plan.receivers}));
  const auto height =
      static_cast<unsigned>(std::min<std::uint64_t>(camera.height, plan.receivers / width));
  std::vector<Pilot> pilots(2 * plan.count);  // some see nothing
  executor.for_each(pilots.size(), [&](std::size_t i, unsigned) {
    const auto place = [&](int axis, unsigned room) {
      const double turn = kGolden[axis] * static_cast<double>(i + 1);
      return static_cast<unsigned>((turn - std::floor(turn)) * (room + 1.0));
    };
    const unsigned x0 = place(0, camera.width - width), y0 = place(1, camera.height - height);
    pilots[i].variant = static_cast<unsigned>(i / 2) % (side * side);
    for (unsigned y = y0; y < y0 + height; ++y) {
      for (unsigned x = x0; x < x0 + width; ++x) {
        const auto [sx, sy] = sample_at(x, y, pilots[i].variant, side);
        if (const auto hit = view.at(sx, sy)) pilots[i].receivers.push_back(receiver_at(*hit));
      }
    }
  });
  std::erase_if(pilots, [](const Pilot& pilot) { return pilot.receivers.empty(); });
  pilots.resize(std::min(pilots.size(), plan.count));
  return pilots;
}

/// Renders one sample of every pixel of a tile into the film. Each of a pixel's samples is shaded
/// with a variant of its own, so that what one of them resolves too coarsely the others average
/// out.
class TileRenderer {
 public:
  /// @param estimator  or null
  TileRenderer(const PrimaryView& view, Shader& shader, Estimator* estimator, Film& film,
               const Camera& camera, unsigned side, const Sky& sky, CheckSample& check,
               const Executor& executor)
      : view_(view),
        shader_(shader),
        estimator_(estimator),
        film_(film),
        camera_(camera),
        side_(side),
        sky_(sky),
        check_(check),
        executor_(executor) {}

  /// The picture, tile by tile.
  void render_all(Progress& progress) {
    for (unsigned y = 0; y < camera_.height; y += kTileSide) {
      for (unsigned x = 0; x < camera_.width; x += kTileSide) {
        const unsigned x1 = std::min(camera_.width, x + kTileSide),
                       y1 = std::min(camera_.height, y + kTileSide);
        for (unsigned sample = 0; sample < side_ * side_; ++sample)
          render(x, y, x1, y1, sample, progress);
      }
    }
  }

  [[nodiscard]] double shade_cpu_seconds() const { return cpu_; }

 private:
  /// @param x0, y0, x1, y1  pixels
  /// @param sample  0 to side^2 - 1
  void render(unsigned x0, unsigned y0, unsigned x1, unsigned y1, unsigned sample,
              Progress& progress) {
    find_hits(x0, y0, x1, y1, sample);
    receivers_.clear();
    for (const auto& hit : hits_) {
      if (hit) receivers_.push_back(receiver_at(*hit));
    }
    results_.resize(receivers_.size());
    const double before = cpu_seconds();
    shader_.shade(receivers_, results_, progress, sample);
    cpu_ += cpu_seconds() - before;
    estimates_ = {};
    if (estimator_) estimates_ = estimator_->estimate(receivers_, results_, sample);
    check_.add(receivers_, results_, estimates_);
    expose(x0, y0, x1, sample);
    progress.advance(hits_.size() - receivers_.size());
  }

  void find_hits(unsigned x0, unsigned y0, unsigned x1, unsigned y1, unsigned sample) {
    const std::size_t columns = x1 - x0;
    hits_.assign(columns * (y1 - y0), std::nullopt);
    executor_.for_each(y1 - y0, [&](std::size_t row, unsigned) {
      for (std::size_t i = 0; i < columns; ++i) {
        const auto [x, y] = sample_at(x0 + static_cast<unsigned>(i),
                                      y0 + static_cast<unsigned>(row), sample, side_);
        hits_[row * columns + i] = view_.at(x, y);
      }
    });
  }

  void expose(unsigned x0, unsigned y0, unsigned x1, unsigned sample) {
    const float weight = 1.0F / static_cast<float>(side_ * side_);
    std::size_t next = 0;
    for (std::size_t i = 0; i < hits_.size(); ++i) {
      const unsigned x = x0 + static_cast<unsigned>(i % (x1 - x0));
      const unsigned y = y0 + static_cast<unsigned>(i / (x1 - x0));
      const std::size_t pixel = std::size_t{y} * film_.width + x;
      if (hits_[i]) {
        if (estimator_) film_.add(pixel, estimates_[next], weight);
        film_.add(pixel, *hits_[i], results_[next++], weight);
      } else {
        const float scale = 1.0F / static_cast<float>(side_);
        const auto [sx, sy] = sample_at(x, y, sample, side_);
        film_.beauty[pixel] +=
            weight * sky_.at(camera_.direction((static_cast<float>(sx) + 0.5F) * scale,
                                               (static_cast<float>(sy) + 0.5F) * scale));
      }
    }
  }

  const PrimaryView& view_;
  Shader& shader_;
  Estimator* estimator_;
  Film& film_;
  const Camera& camera_;
  unsigned side_;
  const Sky& sky_;
  CheckSample& check_;
  const Executor& executor_;
  std::vector<std::optional<PrimaryHit>> hits_;
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::span<const ErrorEstimate> estimates_;
  double cpu_ = 0;
};

}  // namespace

ShadeReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                           Progress& progress) {
  ShadeReport report;
  check_estimate_request(request.estimate, request.error, request.check);
  check_damage_request(request.tolerate_damage, request.bounces, request.error, request.check);
  if (request.estimate &&
      std::ranges::none_of(targets, [](const auto& t) { return t.path.extension() == ".exr"; })) {
    throw std::invalid_argument("estimates are layers of an .exr: name one to write");
  }
  const Executor executor(request.run.threads);
  const ContainerReader scene(request.scene);
  const LightRig lights = request.lights ? *request.lights : recorded_lights(scene);
  const auto side = static_cast<unsigned>(std::lround(std::sqrt(request.samples)));
  if (side * side != request.samples)
    throw std::invalid_argument("samples per pixel must be a square number");

  const std::unique_ptr<LostPages> lost =
      request.tolerate_damage ? std::make_unique<LostPages>(scene) : nullptr;
  std::vector<MeshCamera> cameras;
  Subject subject;
  subject.mesh = load_meshes(request.meshes, request.mesh.get(), request.backdrop, &cameras);
  Camera camera = request.camera ? *request.camera
                                 : default_camera(scene, cameras, request.backdrop, request.size);
  if (request.size) {
    camera.width = (*request.size)[0];
    camera.height = (*request.size)[1];
  }
  const std::uint64_t samples = std::uint64_t{camera.width} * camera.height * request.samples;
  if (!subject.mesh.triangles.empty()) {
    view_mesh_of(subject, request, scene, lights, camera, side);
  } else {
    const Stage stage(report.seconds, progress, "splat", scene.superblock().points, "points");
    subject.view = view_surfels(scene, camera, side, request.lift, lost.get(), executor, progress);
  }
  Film film(camera.width, camera.height, request.estimate);
  ShadeOptions options{.back_end = request.back_end,
                       .gather = request.gather,
                       .sky = sky_function(lights.sky),
                       .lost = lost.get(),
                       .variants = std::min(request.samples, kMostVariants)};
  options.gather.bleeding = request.bounces > 0;
  const std::uint64_t receiver_bytes = kReceiverBytes + (request.estimate ? kEstimateBytes : 0);
  const std::uint64_t pixel_bytes = Film::kBytes + (request.estimate ? Film::kEstimateBytes : 0);
  const std::uint64_t taken =
      kBufferBytes + std::uint64_t{kTileSide} * kTileSide * receiver_bytes +
      std::uint64_t{camera.width} * camera.height * pixel_bytes +
      (subject.rays ? mesh_bytes(subject.mesh, subject.rays.get()) : samples * 24) +
      bounce_bytes(scene, request.bounces, executor.threads());
  options.cache_bytes =
      cache_bytes_left(request.run, taken, scene, readers_of(executor, request.estimate),
                       request.back_end, "this picture");
  const std::unique_ptr<ContainerReader> bounced =
      bounce_light(scene,
                   {request.bounces, options, request.lift,
                    roomiest_temp_dir(request.run, targets.front().path)},
                   executor, report, progress);
  const ContainerReader& lit = bounced ? *bounced : scene;
  ReceiverPlaces compared;
  std::vector<Pilot> pilots;
  if (request.error || request.estimate) pilots = pilots_of(*subject.view, camera, side, executor);
  std::vector<Shading> traced;  // by rays, of the pilots
  if (request.error) {
    const Stage stage(report.seconds, progress, "tune", 0, "receivers");
    report.tuning =
        tune(lit, options, *request.error, pilots, executor, progress, compared, traced);
    options.gather = report.tuning->gather;
  }
  std::unique_ptr<Estimator> estimator;
  if (request.estimate) {
    const Stage stage(report.seconds, progress, "estimate", 0, "receivers");
    if (!request.error) {
      traced = trace_pilots(lit, options, pilots, request.check.rays, executor, progress, compared);
    }
    estimator = std::make_unique<Estimator>(lit, options, pilots, traced, executor);
    options.cache = &estimator->cache();
  }
  std::optional<Shader> shader(std::in_place, lit, options, executor);
  CheckSample check(request.check, std::move(compared));
  {
    const Stage stage(report.seconds, progress, "render", samples, "samples");
    TileRenderer tiles(*subject.view, *shader, estimator.get(), film, camera, side, lights.sky,
                       check, executor);
    tiles.render_all(progress);
    report.shade_cpu_seconds = tiles.shade_cpu_seconds();
  }
  report.gather = shader->counts();
  report.receivers = report.gather.receivers;
  report.bounces = request.bounces;
  if (lost) report.damage = damage_report(scene, *lost, report.gather.damage);
  report.cache = shader->cache_statistics();
  if (estimator) {
    report.cache = estimator->cache_statistics();
    report.estimate = estimator->report();
  }
  film.finish();
  estimator.reset();
  shader.reset();  // its pages make room for what the writers copy
  write_targets(targets, film, request.exposure);
  if (request.check.receivers > 0) {
    const std::uint64_t references = subject.rays ? 4 : 2;
    const Stage stage(report.seconds, progress, "check", references * request.check.receivers,
                      "references");
    const LightSampling sampling{
        .sun_rays = 1, .area_rays = lit_by_emitters(scene) ? 1U : 0U, .sky_rays = 1};
    report.check = check.compare(lit, request.gather.sides, lights.sky, subject.light.get(),
                                 subject.rays.get(), {sampling, request.bounces},
                                 options.cache_bytes, executor, progress);
  }
  return report;
}

}  // namespace ptc
