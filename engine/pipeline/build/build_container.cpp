// A build from the request to the published container.
//
//   sort()           inputs --> ExternalSorter --> spill files, or memory
//                                     |
//   build_sorted()                    v  sorted points
//                     pages of points, nodes and channels --> container
//                                     |
//   light()                           v  only where points are lit when all of them are there
//
// The memory cap goes to the inputs and the sort first; when the sort is done, the directory of the
// output takes its place (build_memory.h).
#include "engine/pipeline/build/build_container.h"

#include <algorithm>
#include <array>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/url.h"
#include "engine/octree/merge.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/build_memory.h"
#include "engine/pipeline/build/build_record.h"
#include "engine/pipeline/build/build_sorted.h"
#include "engine/pipeline/build/feed_inputs.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/build/resume.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/build/scene_part.h"
#include "engine/pipeline/build/still_light.h"
#include "engine/pipeline/light/light_container.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/scan/scan.h"
#include "engine/sort/external_sort.h"
#include "engine/sort/spill.h"
#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/text.h"

namespace ptc {
namespace {

// Bytes of the meta page that are kept for the spacing, which is known only once the meshes are
// sampled: its key, its sizes, and at most 24 characters of a double.
constexpr std::size_t kSpacingBytes = 64;

std::vector<MortonKey> keys_of(const std::vector<glm::dvec3>& places, const Frame& frame) {
  std::vector<MortonKey> keys;
  keys.reserve(places.size());
  for (const glm::dvec3& p : places) keys.push_back(encode_morton(frame.to_lattice(to_array(p))));
  return keys;
}

/// One build, from the request to the published container. run() is called once.
class Build {
 public:
  /// @param part  of a scene that is built; null: the whole
  Build(const BuildRequest& request, BoundsFrom from, const std::filesystem::path& target,
        Progress& progress, ScenePart* part = nullptr)
      : request_(request),
        part_(part),
        bounds_from_(from),
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
    {
      const bool goes_on = resumption_ && resumption_->plan();
      SortedPoints points = goes_on ? SortedPoints{} : sort();
      try {
        if (goes_on) points = take_up();
        build(points);
      } catch (const DataError& error) {  // a kept file changed since it was written
        if (resumption_) resumption_->refuse(error);
        throw;
      }
      report_.sort = points.sorter->statistics();
    }

    // Light the points, complete the report, remove what was kept
    if (unlit_) light();
    if (resumption_) resumption_->remove();
    tell_scan();
    return std::move(report_);
  }

 private:
  void check_request() const {
    check_page_shift(request_.page_shift);
    require_request(request_.tree.leaf_points >= 1 && request_.tree.leaf_points <= kMaxLeafPoints,
                    "tree.leaf_points", "`tree.leaf_points` is not 1 to 65535");
    require_request(request_.tree.levels_per_stream >= 1, "tree.levels_per_stream",
                    "`tree.levels_per_stream` is not 1 or more");
    require_request(request_.selection.every >= 1, "selection.every",
                    "`selection.every` is not 1 or more");
    require_request(!request_.moment || !request_.resume, "resume",
                    "`resume` is for scenes that stand still");
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
    scene_ = std::make_unique<ContainerReader>(with_directory_under(request_.append, request_.run));
    check_extensible(*scene_);
    if (part_) return;
    // Keep the lights of the scene; without meshes to light, their sky picture is not loaded
    if (scene_->meta().text.contains(kLightsKey)) {
      request_.lights =
          has_meshes() ? recorded_lights(*scene_, request_.run, target_, progress_) : LightRig{};
    }
  }

  [[nodiscard]] bool has_meshes() const {
    return request_.mesh ||
           !std::ranges::all_of(object_files(request_.inputs, request_.run.memory_bytes),
                                holds_points);
  }

  [[nodiscard]] std::uint64_t scene_points() const {
    return scene_ ? scene_->superblock().points : 0;
  }

  /// @throws IsOneWhole when what moves is too far away from what stands still
  [[nodiscard]] Frame frame_of(const Bounds& bounds) const {
    if (!part_) return usual_frame_of(bounds);
    try {
      return usual_frame_of(bounds);
    } catch (const RequestError& error) {
      throw IsOneWhole(error.what());
    }
  }

  [[nodiscard]] Frame usual_frame_of(const Bounds& bounds) const {
    if (bounds.empty()) return scene_->header().frame;
    const std::array<double, 3> low = to_array(bounds.low), high = to_array(bounds.high);
    return scene_points() > 0 ? grow_frame(scene_->header().frame, low, high)
                              : frame_around(low, high);
  }

  /// Returns the record for the meta page. @param spacing  as for complete_record()
  [[nodiscard]] Meta record(const Meta& meta, double spacing) const {
    return complete_record(meta, spacing, scene_ && !part_ ? &scene_->meta() : nullptr,
                           request_.page_shift);
  }

  /// Feeds all inputs to a sort, which writes them to the disk when memory does not hold them.
  SortedPoints sort() {
    // Read and measure the inputs, choose the frame
    BuildInputs inputs = part_ ? read_part(request_, *part_, memory().mesh_limits(), executor_,
                                           report_.seconds, progress_)
                               : read_inputs(request_, bounds_from_, scene_.get(),
                                             memory().mesh_limits(), report_.seconds, progress_);
    if (part_) request_.sampling.spacing = part_->spacing;
    report_.las_records = std::move(inputs.clouds.las_records);
    report_.streamed = inputs.streamed != nullptr;
    if (inputs.bounds.empty() && !scene_) {
      std::string names;
      for (const auto& input : request_.inputs) names += input.string() + ": ";
      throw DataError(names + "the input has no points and no triangles");
    }
    if (scene_ && !part_) {
      // What the scene says of its positions holds
      std::map<std::string, std::string> texts = scene_->meta().text, named_by;
      join_texts(texts, named_by, inputs.clouds.text, "what is appended", progress_);
      for (const char* key : {kCrsKey, kUnitKey}) {
        if (!texts.contains(key)) inputs.clouds.text.erase(key);
      }
    }
    if (inputs.streamed) {
      progress_.note(
          std::string("the meshes do not fit in memory: they are sampled piece by piece") +
          (inputs.relight ? ", and lit by rays at the surfels" : ""));
      if (inputs.clouds.points > 0 || scene_points() > 0) {
        progress_.note(
            "all other points are lit anew together with them, also those that have light "
            "of their own");
      }
    }
    if (inputs.relight) light_later(inputs);
    Meta meta = make_meta(request_, inputs);
    if (inputs.clouds.scan && inputs.clouds.points > 0) add_marks(meta);
    check_meta(record(meta, 0), request_.page_shift, kPointBytes,
               inputs.has_meshes() ? kSpacingBytes : 0);
    SortedPoints points{
        .plan = {.frame = frame_of(inputs.bounds),
                 .scan = inputs.clouds.scan,
                 .emits = inputs.emitters || inputs.clouds.emits || (scene_ && may_emit(*scene_))}};
    const Frame& frame = points.plan.frame;

    if (inputs.streamed && request_.sampling.adapts) {
      progress_.note(
          "the meshes do not fit in memory: their surfels are spaced evenly, because an adapted "
          "spacing needs rays at all of them");
    }

    // Charge the inputs to the memory cap
    MemoryBudget budget = memory().budget();
    SamplingRoom room = memory().charge_inputs(inputs, budget);

    // Start the sort, and check that the disks have room. How many surfels a given spacing makes of
    // a mesh is not known beforehand
    const std::uint64_t known = request_.city_points + inputs.clouds.points;
    const std::uint64_t places = inputs.streamed ? inputs.streamed->found.places() : 0;
    const bool by_spacing = inputs.has_meshes() && request_.sampling.spacing > 0;
    const std::uint64_t expected =
        part_ ? expected_surfels(*inputs.lit, request_.sampling.spacing)
        : by_spacing
            ? 0
            : known + (inputs.has_meshes() ? std::max(request_.sampling.count, places) : 0);
    const std::size_t groups = inputs.attributes.groups();
    const AllSortOptions options =
        memory().sort_options(std::move(budget), expected, points.plan.emits, groups);
    const std::vector<MortonKey> sample = keys_of(inputs.sample, frame);
    points.memory_bytes = options.points.memory_bytes;
    points.sorter = std::make_unique<ExternalSorter>(options.points, executor_, sample);
    if (resumption_) resumption_->add_spills(groups);
    points.attributes = std::make_unique<AttributeSorts>(
        inputs.attributes, options.attributes,
        resumption_ ? resumption_->attribute_spills() : std::span<const std::filesystem::path>(),
        executor_, sample);
    tell_space(expected, points.sorter->expected_spill() + points.attributes->expected_spill(),
               options.points.temp_dirs);

    // Feed the points, then plan the container: its record and its UUID depend on all of them
    double spacing = 0;
    {
      const bool is_still = part_ && part_->motion == Motion::still;
      const char* const name = is_still          ? "sample and light what stands still"
                               : inputs.lit      ? "sample and light"
                               : inputs.streamed ? "sample"
                                                 : "partition";
      const Stage stage(report_.seconds, progress_, name, known, "points");
      room.streaming.temp_dirs = options.points.temp_dirs;
      spacing = feed_inputs(inputs, request_, frame, scene_points(), room, *points.sorter,
                            *points.attributes, executor_, progress_);
    }
    points.still_light = std::move(inputs.still_light);
    points.plan.meta = record(meta, spacing);
    check_meta(points.plan.meta, request_.page_shift, points.plan.point_bytes());
    points.plan.uuid =
        content_uuid(points.sorter->digest(), points.attributes->digest(), frame, request_,
                     points.plan.meta, scene_ ? scene_->header().uuid : Uuid{});
    if (resumption_) resumption_->keep(points.plan, *points.sorter, *points.attributes);
    return points;
  }

  /// Lets the points go into a temporary container first.
  void light_later(const BuildInputs& inputs) {
    if (request_.resume) {
      throw RequestError(
          "resume",
          "`resume` is for builds of one stage, and these points are lit when all of "
          "them are there: build without `resume`");
    }
    rig_ = inputs.lights;
    if (inputs.clouds.lights_differ && !request_.lights) {
      progress_.note("the inputs record different lights: those of " +
                     inputs.clouds.named_by.at(kLightsKey) +
                     " light all points; give lights to light them otherwise");
    }
    // The picture of a scene's sky is not loaded where no mesh needs it
    if (scene_ && !has_meshes()) rig_ = recorded_lights(*scene_, request_.run, target_, progress_);
    unlit_path_ = temporary_container_path(roomiest_temp_dir(request_.run, target_));
    unlit_ = std::make_unique<TemporaryName>(unlit_path_);
    if (scene_) {
      progress_.note("the points of " + file_name(scene_->path()) +
                     " are lit anew together with those that are added, because lamps of one would "
                     "not light the other");
    }
  }

  /// Lights the points of the temporary container into the target.
  void light() {
    LightRequest lighting{{.scene = unlit_path_, .run = request_.run}};
    if (scene_) {
      lighting.replaces = &scene_->file();
      lighting.run.hold(ContainerReader::kMaxPageBytes * scene_->page_count());
    }
    lighting.lights = rig_;
    lighting.light_sampling = request_.sampling.lights;
    LightReport lit = light_container(lighting, target_, progress_);
    report_.superblock = ContainerReader(target_).superblock();
    report_.seconds.insert(report_.seconds.end(), lit.seconds.begin(), lit.seconds.end());
  }

  /// Reports the disk space of the build, and refuses the build when there is too little.
  void tell_space(std::uint64_t expected, std::uint64_t spilled,
                  std::span<const std::filesystem::path> temps) {
    report_.space =
        require_build_space(expected + scene_points(), spilled, request_.profile, temps, target_);
    if (spilled > 0) progress_.note(space_text(report_.space, temps, target_));
  }

  /// Reports what was estimated for points that came without normals or radii.
  void tell_scan() const {
    if (scan_.normals > 0)
      progress_.note(fmt::format("the normals of {} points are estimated", scan_.normals));
    if (scan_.outliers > 0) {
      progress_.note(fmt::format("{} points lie far from all others: the channel {} marks them",
                                 scan_.outliers, kOutlierChannel));
    }
    if (scan_.alone > 0) {
      progress_.note(fmt::format(
          "{} points have no neighbours: their radius is 0, and they are not seen", scan_.alone));
    }
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
    const AllSortOptions options = memory().sort_options(
        memory().budget(), expected, emits, channel_groups(points.plan.meta.channels).size());
    points.memory_bytes = options.points.memory_bytes;
    points.sorter = std::make_unique<ExternalSorter>(options.points, executor_, state);
    points.attributes = std::make_unique<AttributeSorts>(options.attributes, executor_, state);
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

  /// Builds the container from the sorted points.
  void build(SortedPoints& points) {
    const std::uint64_t all = scene_points() + points.sorter->statistics().points;
    const Stage stage(report_.seconds, progress_, "sort and build", all, "points");
    const OpenBuild open{.request = request_,
                         .target = target_,
                         .scene = scene_.get(),
                         .resumption = resumption_.get(),
                         .executor = executor_,
                         .progress = progress_};
    report_.superblock = build_sorted(open, points, unlit_ ? unlit_path_ : target_, scan_);
    if (report_.superblock.points < all && !part_) {
      progress_.note(fmt::format("{} points lie where another one does and are left out",
                                 all - report_.superblock.points));
    }
  }

  [[nodiscard]] BuildMemory memory() const {
    return {request_, target_, executor_.threads(), scene_.get(), resumption_.get()};
  }

  BuildRequest request_;
  ScenePart* const part_;
  const BoundsFrom bounds_from_;
  const std::filesystem::path target_;  ///< behind symbolic links
  Progress& progress_;
  const ThreadPool executor_;
  BuildReport report_;
  ScanReport scan_;
  std::unique_ptr<ContainerReader> scene_;  ///< container that is appended to; null: none
  std::unique_ptr<Resumption> resumption_;
  /// The container of points that light() lights; null: they are lit already.
  std::filesystem::path unlit_path_;
  std::unique_ptr<TemporaryName> unlit_;
  LightRig rig_;  ///< for light()
};

}  // namespace

BuildReport build_part(const BuildRequest& request, ScenePart& part,
                       const std::filesystem::path& target, Progress& progress) {
  return Build(request, BoundsFrom::points, target, progress, &part).run();
}

BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target,
                            Progress& progress) {
  try {
    return Build(request, BoundsFrom::files, target, progress).run();
  } catch (const BoundsExceeded& error) {
    progress.note(std::string(error.what()) + ", so all points are read once more");
  }
  return Build(request, BoundsFrom::points, target, progress).run();
}

}  // namespace ptc
