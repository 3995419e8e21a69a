// A build from the request to the published container.
//
//   sort()    inputs --> ExternalSorter --> spill files, or memory
//                              |
//   build()                    v  sorted points, a chain of streams
//             complete_scan       only for inputs without normals or radii
//                              v
//             merge_points        only with `append`: with the points of the scene
//                              v
//             unique_points       only with `remove_duplicates`
//                              v
//             round_points        only in the profiles fast and compact
//                              v
//             build_pages         octree and pages; checkpoints with `resume`
//                              v
//             AttributeSorts      attribute pages, group by group, in the same order
//                              v
//             ContainerWriter::finish()
//
// Every stage of build() is a PointStream that pulls blocks from the one before it, so that no
// stage holds more than its own blocks. The memory cap goes to the inputs and the sort first; when
// the sort is done, the directory of the output takes its place.
#include "engine/pipeline/build/build_container.h"

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/octree/merge.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/build_record.h"
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
#include "engine/scene/sampling/streamed_sampler.h"
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
// in it and in its copies. Pages that wait are in kCopies: the checkpoint that the build continues
// from, the one that is being saved, and the next.
constexpr std::uint64_t kCheckpointBytes = 8 << 20;
constexpr std::uint64_t kOpenPages = 48;
constexpr std::uint64_t kCopies = 3;
// Bytes of the meta page that are kept for the spacing, which is known only once the meshes are
// sampled: its key, its sizes, and at most 24 characters of a double.
constexpr std::size_t kSpacingBytes = 64;
// The least memory of the sort of a group of channels.
constexpr std::uint64_t kMinAttributeSortBytes = std::uint64_t{16} << 20;

std::vector<MortonKey> keys_of(const std::vector<glm::dvec3>& places, const Frame& frame) {
  std::vector<MortonKey> keys;
  keys.reserve(places.size());
  for (const glm::dvec3& p : places) keys.push_back(encode_morton(frame.to_lattice(to_array(p))));
  return keys;
}

/// A sort that has taken all points, and what else the container is made with.
struct SortedPoints {
  std::unique_ptr<ExternalSorter> sorter;
  std::unique_ptr<AttributeSorts> attributes;
  std::uint64_t memory_bytes = 0;  ///< of the sort of points, which are free when it has ended
  BuildPlan plan;
  std::unique_ptr<StillLight> still_light;  ///< of the points of the scene; null: they keep theirs
};

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

  /// Estimates the number of pages of points and nodes. In a city there are some 5 pages of nodes
  /// for each 10 of points; 6 are assumed.
  /// @param emits   whether a point may emit light, so that fewer fit a page
  /// @param groups  of channels, each of which has a page for every page of points
  [[nodiscard]] std::uint64_t pages_of(std::uint64_t points, bool emits, std::size_t groups) const {
    const FileHeader header{.page_shift = request_.page_shift,
                            .point_bytes = BuildPlan{.emits = emits}.point_bytes()};
    return points / points_per_page(header) * (8 + 5 * groups) / 5;
  }

  [[nodiscard]] MemoryBudget build_budget() const {
    MemoryBudget budget = budget_of(request_.run.memory_bytes, "this scene's build");
    if (request_.lights) charge_sky(budget, request_.lights->sky);
    if (std::ranges::any_of(request_.inputs, is_url))
      budget.charge(RemoteFile::kMemory, RemoteFile::kMemoryBytes);
    return budget;
  }

  /// Returns the memory for meshes. While they are read, nothing else takes any.
  [[nodiscard]] MeshLimits mesh_limits() const {
    const MemoryBudget budget = build_budget();
    const std::uint64_t sampling =
        sampling_bytes(0, request_.sampling.count, request_.sampling.adapts, 1);
    // Meshes that are kept leave room for streaming. One that takes less than streaming does is
    // better in memory
    constexpr std::uint64_t kLeast = StreamingRoom::kLeastBytes;
    const std::uint64_t room = std::max(sampling_room(budget, 0), 2 * kLeast) - kLeast;
    return {.reading = std::max(budget.left(), kLeast),
            .kept = room,
            .traced = std::max(sampling_room(budget, sampling), kLeast),
            .textures = texture_cap(request_.run),
            .temp_directory = roomiest_temp_dir(request_.run, target_)};
  }

  /// Returns the memory for sampling that the rest of a build leaves at least.
  /// @param fixed  bytes that sampling takes in any case
  [[nodiscard]] std::uint64_t sampling_room(const MemoryBudget& budget, std::uint64_t fixed) const {
    const std::uint64_t others =
        fixed + kMinSortBytes + held_pages_bytes(request_.page_shift) +
        ContainerWriter::writing_bytes(request_.page_shift, 1);  // no number of threads decides
    return budget.left() > others ? budget.left() - others : 0;
  }

  /// The settings of the sort of points, and of each of the sorts of attributes.
  struct AllSortOptions {
    SortOptions points, attributes;
  };

  /// Gives the sorts the memory that the cap leaves: kMinSortBytes to that of the points, and equal
  /// shares of the rest to all of them. When they are done, the directory takes their place.
  /// @param budget    already charged with the inputs
  /// @param expected  number of points that will come; 0 when it is not known
  /// @param emits     whether a point may emit light
  /// @param groups    number of sorts of attributes
  [[nodiscard]] AllSortOptions sort_options(MemoryBudget budget, std::uint64_t expected, bool emits,
                                            std::size_t groups) const {
    const std::uint64_t pages = pages_of(expected + scene_points(), emits, groups);
    budget.charge("pages that are written",
                  ContainerWriter::writing_bytes(request_.page_shift, executor_.threads()));
    const std::uint64_t held = held_pages_bytes(request_.page_shift);
    budget.charge("node pages that wait", held);
    if (scene_) {
      budget.charge("the directory of " + file_name(scene_->path()),
                    ContainerReader::kMaxPageBytes * scene_->page_count());
    }
    if (resumption_) {
      budget.charge("checkpoints",
                    kCheckpointBytes + (kOpenPages << request_.page_shift) + kCopies * held);
    }
    const std::uint64_t directory_bytes = ContainerWriter::finish_bytes(pages);
    const std::uint64_t least = kMinSortBytes + groups * kMinAttributeSortBytes;
    const std::uint64_t memory = directory_bytes > least
                                     ? budget.rest("the output's directory", directory_bytes)
                                     : budget.rest("the sort", least);
    const std::uint64_t share = (memory - kMinSortBytes) / (groups + 1);
    const SortOptions options{.memory_bytes = memory - groups * share,
                              .temp_dirs = temp_dirs(request_.run, target_),
                              .expected = expected,
                              .emits = emits};
    AllSortOptions all{.points = options, .attributes = options};
    all.attributes.memory_bytes = share;
    if (resumption_) all.points.kept_files = resumption_->spills();
    return all;
  }

  /// Feeds all inputs to a sort, which writes them to the disk when memory does not hold them.
  SortedPoints sort() {
    // Read and measure the inputs, choose the frame
    BuildInputs inputs =
        part_ ? read_part(request_, *part_, mesh_limits(), executor_, report_.seconds, progress_)
              : read_inputs(request_, bounds_from_, scene_.get(), mesh_limits(), report_.seconds,
                            progress_);
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

    // Charge the inputs to the memory cap
    SamplingRoom room;
    MemoryBudget budget = build_budget();
    if (!request_.lights) charge_sky(budget, inputs.lights.sky);
    if (request_.mesh) charge_mesh(budget, *request_.mesh, nullptr);
    if (const LitMesh* lit = inputs.lit.get()) {
      charge_mesh(budget, lit->mesh, &lit->rays);
      // What is too small for any memory is refused as such
      static_cast<void>(with_spacing(request_.sampling, sampled_area(lit->mesh)));
      const std::uint64_t surfels =
          request_.sampling.spacing > 0 ? points_of(*lit) : request_.sampling.count;
      const std::uint64_t fixed =
          sampling_bytes(lit->mesh.triangles.size(), surfels, request_.sampling.adapts, 0);
      const std::uint64_t writers =
          ContainerWriter::writing_bytes(request_.page_shift, executor_.threads()) -
          ContainerWriter::writing_bytes(request_.page_shift, 1);
      room.at_once = static_cast<unsigned>(std::clamp<std::uint64_t>(
          sampling_room(budget, fixed + writers) / kSampledPatchBytes, 1, executor_.threads()));
      budget.charge("sampling", fixed + room.at_once * kSampledPatchBytes);
    }
    if (const StreamedMeshes* streamed = inputs.streamed.get()) {
      if (request_.sampling.adapts) {
        progress_.note(
            "the meshes do not fit in memory: their surfels are spaced evenly, because an adapted "
            "spacing needs rays at all of them");
      }
      budget.charge("the meshes", streamed->parts.bytes());
      std::vector<Material> materials = streamed->parts.materials();
      for (const PlacedMesh& placed : streamed->parts.placed())
        materials.insert(materials.end(), placed.mesh->materials.begin(),
                         placed.mesh->materials.end());
      charge_textures(budget, materials);
      const std::uint64_t fixed =
          streaming_bytes(streamed->found, with_spacing(request_.sampling, streamed->found.area));
      room.streaming.memory_bytes =
          std::clamp(sampling_room(budget, fixed) / 2, StreamingRoom::kLeastBytes,
                     std::max(8U, executor_.threads()) * StreamingRoom::kLeastBytes);
      budget.charge("sampling", fixed + room.streaming.memory_bytes);
    }

    // Start the sort, and check that the disks have room. How many surfels a given spacing makes of
    // a mesh is not known beforehand
    const std::uint64_t known = request_.city_points + inputs.clouds.points;
    const std::uint64_t places = inputs.streamed ? inputs.streamed->found.places() : 0;
    const bool by_spacing = inputs.has_meshes() && request_.sampling.spacing > 0;
    const std::uint64_t expected =
        part_ ? points_of(*inputs.lit)
        : by_spacing
            ? 0
            : known + (inputs.has_meshes() ? std::max(request_.sampling.count, places) : 0);
    const std::size_t groups = inputs.attributes.groups();
    const AllSortOptions options =
        sort_options(std::move(budget), expected, points.plan.emits, groups);
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

  /// Estimates the number of surfels that the spacing makes of a part of a scene.
  [[nodiscard]] std::uint64_t points_of(const LitMesh& lit) const {
    constexpr double kMost = 1e15;
    const double spacing = request_.sampling.spacing;
    return static_cast<std::uint64_t>(
        std::min(kMost, sampled_area(lit.mesh, lit.first) / (spacing * spacing)));
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
    const AllSortOptions options = sort_options(build_budget(), expected, emits,
                                                channel_groups(points.plan.meta.channels).size());
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

  /// Builds the container from the sorted points and publishes it.
  void build(SortedPoints& points) {
    // Create the container, or reopen it as it was at the checkpoint
    const BuildPlan& plan = points.plan;
    const std::uint64_t all = scene_points() + points.sorter->statistics().points;
    const Stage stage(report_.seconds, progress_, "sort and build", all, "points");
    const Checkpoint* const from =
        resumption_ && resumption_->checkpoint() ? &*resumption_->checkpoint() : nullptr;
    const std::filesystem::path& target = unlit_ ? unlit_path_ : target_;
    ContainerWriter writer = from ? ContainerWriter(target, writer_options(plan), from->writer)
                                  : ContainerWriter(target, writer_options(plan));
    const BuildPlace place = from ? from->place : BuildPlace{};
    progress_.advance(place.points);

    // Find the first sorted point that is needed. A stage that looks at all points begins again,
    // because a checkpoint records its place in the stream behind it alone
    const bool whole = scene_ || plan.scan || request_.remove_duplicates;
    const auto needed = whole ? first_of_all : first_for_itself;

    // Chain the streams
    std::optional<PointMarks> marks;
    if (plan.scan) marks.emplace(roomiest_temp_dir(request_.run, target_));
    StreamChain chain(points.sorter->finish(needed(place.points)));
    if (plan.scan) complete(chain, points);
    join(
        chain, plan.frame, [&] { return std::make_unique<ContainerPoints>(*scene_); },
        points.still_light.get());
    if (marks) {
      chain.add(marks->tap(chain.last()));
      read_ahead_of(chain);
    }
    if (whole) pass_over(chain.last(), place.points);
    if (is_rounded(request_.profile))
      chain.add(round_points(chain.last(), plan.frame.unit(), executor_, place.last_key));

    // Write all pages and publish the container
    const Superblock superblock = build_from(chain.last(), writer, *points.sorter, needed);
    write_attributes(plan, *points.attributes, marks ? &*marks : nullptr, superblock.points,
                     writer);
    if (superblock.points < all && !part_) {
      progress_.note(fmt::format("{} points lie where another one does and are left out",
                                 all - superblock.points));
    }
    report_.superblock = writer.finish(plan.meta, superblock);
  }

  [[nodiscard]] WriterOptions writer_options(const BuildPlan& plan) const {
    WriterOptions options{.page_shift = request_.page_shift,
                          .codec = codec_of(request_.profile),
                          .uuid = plan.uuid,
                          .frame = plan.frame,
                          .point_bytes = plan.point_bytes()};
    if (resumption_) options.partial = resumption_->partial();
    if (scene_) options.source = &scene_->file();
    return options;
  }

  /// Streams of which each but the first pulls its points from the one before.
  class StreamChain {
   public:
    explicit StreamChain(std::unique_ptr<PointStream> first) { add(std::move(first)); }
    /// Ends the streams from the last one on, because a stream may be read until it ends.
    ~StreamChain() {
      while (!streams_.empty()) streams_.pop_back();
    }
    void add(std::unique_ptr<PointStream> next) { streams_.push_back(std::move(next)); }
    [[nodiscard]] PointStream& last() const { return *streams_.back(); }

   private:
    std::vector<std::unique_ptr<PointStream>> streams_;
  };

  /// Adds the stage that estimates what the inputs do not give.
  void complete(StreamChain& chain, const SortedPoints& points) {
    ScanOptions scan = *points.plan.scan;
    scan.memory_bytes = points.memory_bytes;
    scan.temp_dirs = temp_dirs(request_.run, target_);
    chain.add(marked_points(
        complete_scan(chain.last(), points.plan.frame, scan, executor_, progress_, scan_)));
  }

  /// Lets another thread read what the chain yields, where there is one.
  void read_ahead_of(StreamChain& chain) const {
    if (executor_.threads() > 1) chain.add(read_ahead(chain.last()));
  }

  /// Adds the stages that merge sorted points with those of the scene and that drop duplicates.
  /// @param open_scene  returns the stream of the scene's points, in the frame of the scene
  /// @param light       lights the points of the scene; null: they keep their light
  void join(StreamChain& chain, const Frame& frame,
            const std::function<std::unique_ptr<PointStream>()>& open_scene,
            const StillLight* light = nullptr) const {
    if (scene_) {
      PointStream& added = chain.last();
      chain.add(open_scene());
      if (light) chain.add(light->light(chain.last(), scene_->header().frame, executor_));
      chain.add(move_points(chain.last(), scene_move(frame)));
      chain.add(merge_points(chain.last(), added));
    }
    if (request_.remove_duplicates) chain.add(unique_points(chain.last()));
  }

  /// Writes the pages of all groups of channels.
  /// @param marks  of the scan; null: there was none
  void write_attributes(const BuildPlan& plan, AttributeSorts& sorts, const PointMarks* marks,
                        std::uint64_t points, ContainerWriter& writer) {
    const std::vector<Channel>& channels = plan.meta.channels;
    const AttributePlan attributes = plan_of(scene_ ? &scene_->meta().channels : nullptr, channels);
    std::uint8_t number = kFirstInputGroup;
    for (std::size_t group = 0; group < sorts.size(); ++group, ++number) {
      StreamChain chain(sorts.finish(group));
      join(chain, plan.frame, [&] { return container_attributes(*scene_, attributes, group); });
      if (marks) chain.add(marks->put_into(&chain.last(), number, channels));
      read_ahead_of(chain);
      write_attribute_pages(chain.last(), number, channels, points, writer);
    }
    if (!marks || channels.empty() || channels.back().group < number) return;
    const auto rest = marks->put_into(nullptr, number, channels);
    write_attribute_pages(*rest, number, channels, points, writer);
  }

  /// Returns how the points of the scene move into the frame of the new container.
  [[nodiscard]] LatticeMove scene_move(const Frame& frame) const {
    return {scene_points() > 0 ? scene_->header().frame : frame, frame};
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

  // Each returns the first sorted point that is needed to continue at `point`
  static std::uint64_t first_for_itself(std::uint64_t point) { return point; }
  static std::uint64_t first_of_all(std::uint64_t /*point*/) { return 0; }

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
