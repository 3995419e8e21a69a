// A build from the request to the published container.
//
//   sort()    inputs --> ExternalSorter --> spill files, or memory
//                              |
//   build()                    v  sorted points, a chain of streams
//             estimate_radii      only for inputs without radii
//                              v
//             merge_points        only with `append`: with the points of the scene
//                              v
//             round_points        only in the profiles fast and compact
//                              v
//             build_pages         octree and pages; checkpoints with `resume`
//                              v
//             ContainerWriter::finish()
//
// Every stage of build() is a PointStream that pulls blocks from the one before it, so that no
// stage holds more than its own blocks. The memory cap goes to the inputs and the sort first; when
// the sort is done, the directory of the output takes its place.
#include "engine/pipeline/build/build_container.h"

#include <algorithm>
#include <array>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/octree/merge.h"
#include "engine/octree/radius.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/resume.h"
#include "engine/pipeline/scene_record.h"
#include "engine/sort/external_sort.h"
#include "engine/sort/point_streams.h"
#include "engine/sort/spill.h"
#include "engine/store/container_points.h"
#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/text.h"

namespace ptc {
namespace {

// Memory of a checkpoint that is being saved: kCheckpointBytes, and as many open pages as there are
// in it and in its copies.
constexpr std::uint64_t kCheckpointBytes = 8 << 20;
constexpr std::uint64_t kOpenPages = 48;
// Bytes of the meta page that are kept for the spacing, which is known only once the meshes are
// sampled: its key, its sizes, and at most 24 characters of a double.
constexpr std::size_t kSpacingBytes = 64;

std::vector<MortonKey> keys_of(const std::vector<glm::dvec3>& places, const Frame& frame) {
  std::vector<MortonKey> keys;
  keys.reserve(places.size());
  for (const glm::dvec3& p : places) keys.push_back(encode_morton(frame.to_lattice(to_array(p))));
  return keys;
}

/// Returns the record of the inputs and the request, without the spacing of the surfels.
Meta make_meta(const BuildRequest& request, const BuildInputs& inputs) {
  Meta meta;
  std::string names;
  for (const auto& input : request.inputs) {
    if (!names.empty()) names += ' ';
    names += printable(input.filename().string());
  }
  if (request.city_points > 0) names = "city " + std::to_string(request.city_points);
  meta.text[kInputsKey] = names;
  meta.text[kLightsKey] = lights_record(inputs.lights);
  if (inputs.emitters && request.sampling.lights.area_rays > 0) meta.text[kEmittersKey] = "baked";
  if (is_rounded(request.profile)) meta.text[kRoundingKey] = kRounding;
  if (request.sampling.camera) meta.text[kCameraKey] = to_json(*request.sampling.camera);
  return meta;
}

/// Cuts a list of names to what a quarter of a page holds.
std::string shortened(const std::string& names, std::uint8_t page_shift) {
  const std::size_t most = std::size_t{1} << page_shift >> 2;
  if (names.size() <= most) return names;
  const std::size_t end = names.rfind(' ', most);
  return end == std::string::npos ? std::string("...") : names.substr(0, end) + " ...";
}

/// Returns the UUID of a container. Equal points, settings and record give an equal file, so they
/// are all that the UUID is made of.
/// @param scene  UUID of the container that the points are appended to; zeros when there is none
Uuid content_uuid(const ExternalSorter& sorter, const Frame& frame, const BuildRequest& request,
                  const Meta& meta, const Uuid& scene) {
  std::string text = fmt::format(
      "{:x} {:x} {} {} {} {} {} {} {} {}", sorter.digest()[0], sorter.digest()[1], frame.origin[0],
      frame.origin[1], frame.origin[2], frame.edge, request.tree.leaf_points,
      request.tree.levels_per_stream, request.page_shift, static_cast<int>(request.profile));
  for (const auto& [key, value] : meta.text)
    text.append("\n").append(key).append("=").append(value);
  if (scene != Uuid{})
    text.append("\n").append(reinterpret_cast<const char*>(scene.data()), scene.size());
  return uuid_of(std::as_bytes(std::span(text)));
}

/// A sort that has taken all points, and what else the container is made with.
struct SortedPoints {
  std::unique_ptr<ExternalSorter> sorter;
  BuildPlan plan;
};

/// One build, from the request to the published container. run() is called once.
class Build {
 public:
  Build(const BuildRequest& request, const std::filesystem::path& target, Progress& progress)
      : request_(request),
        target_(behind_links(target)),
        progress_(progress),
        executor_(request.run.threads) {}

  BuildReport run() {
    // Check the request, open the scene and what an interrupted build left
    check_request();
    if (!request_.append.empty()) open_scene();
    if (request_.resume) resumption_ = std::make_unique<Resumption>(request_, target_);
    if (resumption_ && resumption_->plan() && was_published()) return std::move(report_);
    if (resumption_ && resumption_->sort_unfinished()) {
      progress_.note("the interrupted build had not finished its sort: it starts again");
    }

    // Sort the points, or reopen the sorted ones, and build the container
    const bool goes_on = resumption_ && resumption_->plan();
    SortedPoints points = goes_on ? SortedPoints{} : sort();
    try {
      if (goes_on) points = take_up();
      build(points);
    } catch (const DataError& error) {  // a kept file changed since it was written
      if (resumption_) resumption_->refuse(error);
      throw;
    }

    // Complete the report, remove what was kept
    report_.sort = points.sorter->statistics();
    if (resumption_) resumption_->remove();
    tell_lone_points();
    return std::move(report_);
  }

 private:
  void check_request() const {
    check_page_shift(request_.page_shift);
    require_request(request_.tree.leaf_points >= 1 && request_.tree.leaf_points <= kMaxLeafPoints,
                    "tree.leaf_points", "`tree.leaf_points` is not 1 to 65535");
    require_request(request_.tree.levels_per_stream >= 1, "tree.levels_per_stream",
                    "`tree.levels_per_stream` is not 1 or more");
    require_request(request_.checkpoint_points >= 1, "checkpoint_points",
                    "`checkpoint_points` is not 1 or more");
    require_request(request_.city_points == 0 || (!request_.mesh && request_.inputs.empty()),
                    "city_points",
                    "`city_points` excludes files and meshes: the city is a scene of its own");
    if (has_meshes() || request_.sampling.camera) check_sampling(request_.sampling);
    if (request_.lights) check_lights(*request_.lights);
  }

  /// Opens the container that the points are appended to, and takes over its lights.
  void open_scene() {
    std::error_code absent;
    if (request_.resume && std::filesystem::equivalent(request_.append, target_, absent)) {
      throw RequestError("resume",
                         "`resume` with `append` needs a target other than the scene: the same "
                         "command could not begin again once " +
                             target_.string() + " is replaced");
    }
    if (request_.city_points > 0) {
      throw RequestError("append",
                         "`append` excludes `city_points`: the points to append are read from "
                         "files");
    }
    scene_ = std::make_unique<ContainerReader>(request_.append);
    check_extensible(*scene_);
    // Keep the lights of the scene; without meshes to light, their sky picture is not loaded
    if (scene_->meta().text.contains(kLightsKey)) {
      request_.lights = has_meshes() ? recorded_lights(*scene_, progress_) : LightRig{};
    }
  }

  [[nodiscard]] bool has_meshes() const {
    return request_.mesh || !std::ranges::all_of(request_.inputs, is_point_file);
  }

  [[nodiscard]] std::uint64_t scene_points() const {
    return scene_ ? scene_->superblock().points : 0;
  }

  [[nodiscard]] Frame frame_of(const Bounds& bounds) const {
    if (bounds.empty()) return scene_->header().frame;
    const std::array<double, 3> low = to_array(bounds.low), high = to_array(bounds.high);
    return scene_points() > 0 ? grow_frame(scene_->header().frame, low, high)
                              : frame_around(low, high);
  }

  /// Returns the record for the meta page.
  /// @param meta     from make_meta()
  /// @param spacing  between the surfels on meshes, scene units; 0: not known, or no meshes
  [[nodiscard]] Meta record(Meta meta, double spacing) const {
    if (spacing > 0) meta.text[kSpacingKey] = fmt::format("{}", spacing);
    if (scene_) meta = extended_meta(scene_->meta(), meta);
    std::string& names = meta.text[kInputsKey];
    names = shortened(names, request_.page_shift);
    return meta;
  }

  /// Estimates the number of pages of points and nodes. In a city there are some 4 pages of nodes
  /// for each 10 of points; 5 are assumed.
  /// @param emits  whether a point may emit light, so that fewer fit a page
  [[nodiscard]] std::uint64_t pages_of(std::uint64_t points, bool emits) const {
    const FileHeader header{.page_shift = request_.page_shift,
                            .point_bytes = BuildPlan{.emits = emits}.point_bytes()};
    return points / points_per_page(header) * 3 / 2;
  }

  [[nodiscard]] MemoryBudget build_budget() const {
    return budget_of(request_.run.memory_bytes, "this scene's build");
  }

  /// Gives the sort the memory that the cap leaves. When the sort is done, the directory takes its
  /// place.
  /// @param budget    already charged with the inputs
  /// @param expected  number of points that will come; 0 when it is not known
  /// @param emits     whether a point may emit light
  [[nodiscard]] SortOptions sort_options(MemoryBudget budget, std::uint64_t expected,
                                         bool emits) const {
    const std::uint64_t pages = pages_of(expected + scene_points(), emits);
    budget.charge("pages that are written",
                  ContainerWriter::writing_bytes(request_.page_shift, executor_.threads()));
    if (scene_) {
      budget.charge("the directory of " + scene_->path().filename().string(),
                    ContainerReader::kMaxPageBytes * scene_->page_count());
    }
    if (resumption_) {
      budget.charge("checkpoints", kCheckpointBytes + (kOpenPages << request_.page_shift));
    }
    const std::uint64_t directory_bytes = ContainerWriter::finish_bytes(pages);
    SortOptions options{.memory_bytes = directory_bytes > kMinSortBytes
                                            ? budget.rest("the output's directory", directory_bytes)
                                            : budget.rest("the sort", kMinSortBytes),
                        .temp_dirs = temp_dirs(request_.run, target_),
                        .expected = expected,
                        .emits = emits};
    if (resumption_) options.kept_files = resumption_->spills();
    return options;
  }

  /// Feeds all inputs to a sort, which writes them to the disk when memory does not hold them.
  SortedPoints sort() {
    // Read and measure the inputs, choose the frame
    BuildInputs inputs = read_inputs(request_, report_.seconds, progress_);
    if (inputs.bounds.empty() && !scene_)
      throw DataError("the input has no points and no triangles");
    const Meta meta = make_meta(request_, inputs);
    check_meta(record(meta, 0), request_.page_shift, kPointBytes, inputs.lit ? kSpacingBytes : 0);
    SortedPoints points{.plan = {.frame = frame_of(inputs.bounds),
                                 .estimate_radii = inputs.clouds.estimate_radii,
                                 .emits = inputs.emitters || inputs.clouds.emits ||
                                          (scene_ && scene_->header().point_bytes != kPointBytes)}};
    const Frame& frame = points.plan.frame;

    // Charge the inputs to the memory cap
    MemoryBudget budget = build_budget();
    if (request_.mesh) charge_mesh(budget, *request_.mesh, nullptr);
    if (const LitMesh* lit = inputs.lit.get()) {
      charge_mesh(budget, lit->mesh, &lit->rays);
      budget.charge("sampling", sampling_bytes(lit->mesh.triangles.size(), request_.sampling.count,
                                               executor_.threads()));
    }

    // Start the sort, and check that the disks have room. How many surfels a given spacing makes of
    // a mesh is not known beforehand
    const std::uint64_t known = request_.city_points + inputs.clouds.points;
    const bool by_spacing = inputs.lit && request_.sampling.spacing > 0;
    const std::uint64_t expected =
        by_spacing ? 0 : known + (inputs.lit ? request_.sampling.count : 0);
    const SortOptions options = sort_options(std::move(budget), expected, points.plan.emits);
    points.sorter =
        std::make_unique<ExternalSorter>(options, executor_, keys_of(inputs.sample, frame));
    tell_space(expected, points.sorter->expected_spill(), options.temp_dirs);

    // Feed the points, then plan the container: its record and its UUID depend on all of them
    double spacing = 0;
    {
      const Stage stage(report_.seconds, progress_, inputs.lit ? "sample and light" : "partition",
                        known, "points");
      spacing = feed_inputs(inputs, request_, frame, *points.sorter, executor_, progress_);
    }
    points.plan.meta = record(meta, spacing);
    check_meta(points.plan.meta, request_.page_shift, points.plan.point_bytes());
    points.plan.uuid = content_uuid(*points.sorter, frame, request_, points.plan.meta,
                                    scene_ ? scene_->header().uuid : Uuid{});
    if (resumption_) resumption_->keep(points.plan, *points.sorter);
    return points;
  }

  /// Reports the disk space of the build, and refuses the build when there is too little.
  void tell_space(std::uint64_t expected, std::uint64_t spilled,
                  std::span<const std::filesystem::path> temps) {
    report_.space =
        require_build_space(expected + scene_points(), spilled, request_.profile, temps, target_);
    if (spilled > 0) progress_.note(space_text(report_.space, temps, target_));
  }

  /// Reports points whose radius could not be estimated. Points that an interrupted build had built
  /// are not counted.
  void tell_lone_points() const {
    if (radius_counts_.without_radius == 0) return;
    progress_.note(fmt::format(
        "the input gives no radii, and those of {} points cannot be estimated, because all points "
        "near them lie in the same place: their radius is 0, and they are not seen",
        radius_counts_.without_radius));
  }

  /// Reopens the sorted points of an interrupted build.
  SortedPoints take_up() {
    SortedPoints points{.plan = *resumption_->plan()};
    StateReader state = resumption_->sorter_state();
    std::uint64_t spilled = 0;
    for (const auto& file : resumption_->spills()) {
      std::error_code missing;  // taking up the sort names a file that is gone
      const std::uintmax_t bytes = std::filesystem::file_size(file, missing);
      if (!missing) spilled += bytes;
    }
    const bool emits = points.plan.emits;
    const std::uint64_t expected = spilled / (emits ? kEmittingBytes : kSpilledBytes);
    points.sorter = std::make_unique<ExternalSorter>(sort_options(build_budget(), expected, emits),
                                                     executor_, state);
    state.end();
    if (const auto& checkpoint = resumption_->checkpoint())
      report_.resumed_points = checkpoint->place.points;
    progress_.note(fmt::format("continuing with {} of {} points in {}", report_.resumed_points,
                               scene_points() + points.sorter->statistics().points,
                               resumption_->partial().string()));
    return points;
  }

  /// Returns true when an earlier build was killed between the publication of the container and the
  /// removal of its files. Removes them then.
  bool was_published() {
    if (std::filesystem::file_size(resumption_->partial()) > 0 || !std::filesystem::exists(target_))
      return false;
    try {
      const ContainerReader published(target_);
      report_.superblock = published.superblock();
      if (published.header().uuid != resumption_->plan()->uuid ||
          report_.superblock.writer != writer_name())
        return false;
    } catch (const FormatError&) {
      return false;  // the target is an older file
    }
    report_.resumed_points = report_.superblock.points;
    resumption_->remove();
    return true;
  }

  /// Builds the container from the sorted points and publishes it.
  void build(SortedPoints& points) {
    // Create the container, or reopen it as it was at the checkpoint
    const BuildPlan& plan = points.plan;
    const std::uint64_t all = scene_points() + points.sorter->statistics().points;
    const Stage stage(report_.seconds, progress_, "sort and build", all, "points");
    WriterOptions options{.page_shift = request_.page_shift,
                          .codec = codec_of(request_.profile),
                          .uuid = plan.uuid,
                          .frame = plan.frame,
                          .point_bytes = plan.point_bytes()};
    if (resumption_) options.partial = resumption_->partial();
    if (scene_) options.source = &scene_->file();
    const Checkpoint* const from =
        resumption_ && resumption_->checkpoint() ? &*resumption_->checkpoint() : nullptr;
    ContainerWriter writer =
        from ? ContainerWriter(target_, options, from->writer) : ContainerWriter(target_, options);
    const BuildPlace place = from ? from->place : BuildPlace{};
    progress_.advance(place.points);

    // Find the first sorted point that is needed. A build that appends merges again from the
    // beginning, because a checkpoint records its place in the merged stream alone
    const std::uint64_t first = scene_ ? 0 : place.points;
    const auto needed = scene_                ? first_of_all
                        : plan.estimate_radii ? first_for_radii
                                              : first_for_itself;

    // Chain the streams: estimate radii, merge with the scene, round
    const std::unique_ptr<PointStream> sorted = points.sorter->finish(needed(first));
    std::unique_ptr<PointStream> with_radii, old, moved, merged, rounded;
    PointStream* stream = sorted.get();
    if (plan.estimate_radii)
      stream =
          (with_radii = estimate_radii(*stream, plan.frame.unit(), radius_counts_, first)).get();
    if (scene_) {
      old = std::make_unique<ContainerPoints>(*scene_);
      moved = move_points(
          *old, LatticeMove(scene_points() > 0 ? scene_->header().frame : plan.frame, plan.frame));
      stream = (merged = merge_points(*moved, *stream)).get();
      pass_over(*stream, place.points);
    }
    if (is_rounded(request_.profile)) {
      stream =
          (rounded = round_points(*stream, plan.frame.unit(), executor_, place.last_key)).get();
    }

    // Write all pages and publish the container
    report_.superblock =
        writer.finish(plan.meta, build_from(*stream, writer, *points.sorter, needed));
  }

  /// Builds the pages, from the checkpoint when there is one, and saves further checkpoints.
  Superblock build_from(PointStream& points, ContainerWriter& writer, ExternalSorter& sorter,
                        std::uint64_t (*needed)(std::uint64_t)) {
    if (!resumption_) return build_pages(points, writer, request_.tree, executor_, progress_);
    CheckpointSaver saver(*resumption_, writer, sorter, needed);
    Checkpoints checkpoints{.interval = request_.checkpoint_points,
                            .save = [&](const BuildPlace& at, std::vector<std::byte> state) {
                              saver.save(at, std::move(state));
                            }};
    if (!resumption_->checkpoint())
      return build_pages(points, writer, request_.tree, executor_, progress_, checkpoints);
    StateReader state = resumption_->build_state();
    checkpoints.from = &state;
    return build_pages(points, writer, request_.tree, executor_, progress_, checkpoints);
  }

  // Each returns the first sorted point that is needed to continue at `point`, as first_for_radii()
  static std::uint64_t first_for_itself(std::uint64_t point) { return point; }
  static std::uint64_t first_of_all(std::uint64_t /*point*/) { return 0; }

  BuildRequest request_;
  const std::filesystem::path target_;  ///< behind symbolic links
  Progress& progress_;
  const ThreadPool executor_;
  BuildReport report_;
  RadiusCounts radius_counts_;
  std::unique_ptr<ContainerReader> scene_;  ///< container that is appended to; null: none
  std::unique_ptr<Resumption> resumption_;
};

}  // namespace

BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target,
                            Progress& progress) {
  return Build(request, target, progress).run();
}

}  // namespace ptc
