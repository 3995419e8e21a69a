#include "engine/pipeline/build/build_sorted.h"

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "engine/octree/build_pages.h"
#include "engine/octree/merge.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/sort/point_streams.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"

namespace ptc {
namespace {

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

// Each returns the first sorted point that is needed to continue at `point`
std::uint64_t first_for_itself(std::uint64_t point) {
  return point;
}
std::uint64_t first_of_all(std::uint64_t /*point*/) {
  return 0;
}

/// build_sorted(). run() is called once.
class SortedBuild {
 public:
  SortedBuild(const OpenBuild& open, ScanReport& scan) : open_(open), scan_(scan) {}

  Superblock run(SortedPoints& points, const std::filesystem::path& path) {
    // Create the container, or reopen it as it was at the checkpoint
    const BuildPlan& plan = points.plan;
    const Checkpoint* const from = open_.resumption && open_.resumption->checkpoint()
                                       ? &*open_.resumption->checkpoint()
                                       : nullptr;
    ContainerWriter writer = from ? ContainerWriter(path, writer_options(plan), from->writer)
                                  : ContainerWriter(path, writer_options(plan));
    const BuildPlace place = from ? from->place : BuildPlace{};
    open_.progress.advance(place.points);

    // Find the first sorted point that is needed. A stage that looks at all points begins again,
    // because a checkpoint records its place in the stream behind it alone
    const bool whole = open_.scene || plan.scan || open_.request.remove_duplicates;
    const auto needed = whole ? first_of_all : first_for_itself;

    // Chain the streams
    std::optional<PointMarks> marks;
    if (plan.scan) marks.emplace(roomiest_temp_dir(open_.request.run, open_.target));
    StreamChain chain(points.sorter->finish(needed(place.points)));
    if (plan.scan) complete(chain, points);
    join(
        chain, plan.frame, [&] { return std::make_unique<ContainerPoints>(*open_.scene); },
        points.still_light.get());
    if (marks) {
      chain.add(marks->tap(chain.last()));
      read_ahead_of(chain);
    }
    if (whole) pass_over(chain.last(), place.points);
    if (is_rounded(open_.request.profile))
      chain.add(round_points(chain.last(), plan.frame.unit(), open_.executor, place.last_key));

    // Write all pages and publish the container
    const Superblock superblock = build_from(chain.last(), writer, *points.sorter, needed);
    write_attributes(plan, *points.attributes, marks ? &*marks : nullptr, superblock.points,
                     writer);
    return writer.finish(plan.meta, superblock);
  }

 private:
  [[nodiscard]] WriterOptions writer_options(const BuildPlan& plan) const {
    WriterOptions options{.page_shift = open_.request.page_shift,
                          .codec = codec_of(open_.request.profile),
                          .uuid = plan.uuid,
                          .frame = plan.frame,
                          .point_bytes = plan.point_bytes()};
    if (open_.resumption) options.partial = open_.resumption->partial();
    if (open_.scene) options.source = &open_.scene->file();
    return options;
  }

  /// Adds the stage that estimates what the inputs do not give.
  void complete(StreamChain& chain, const SortedPoints& points) {
    ScanOptions scan = *points.plan.scan;
    scan.memory_bytes = points.memory_bytes;
    scan.temp_dirs = temp_dirs(open_.request.run, open_.target);
    chain.add(marked_points(complete_scan(chain.last(), points.plan.frame, scan, open_.executor,
                                          open_.progress, scan_)));
  }

  /// Lets another thread read what the chain yields, where there is one.
  void read_ahead_of(StreamChain& chain) const {
    if (open_.executor.threads() > 1) chain.add(read_ahead(chain.last()));
  }

  /// Adds the stages that merge sorted points with those of the scene and that drop duplicates.
  /// @param open_scene  returns the stream of the scene's points, in the frame of the scene
  /// @param light       lights the points of the scene; null: they keep their light
  void join(StreamChain& chain, const Frame& frame,
            const std::function<std::unique_ptr<PointStream>()>& open_scene,
            const StillLight* light = nullptr) const {
    if (open_.scene) {
      PointStream& added = chain.last();
      chain.add(open_scene());
      if (light) chain.add(light->light(chain.last(), open_.scene->header().frame, open_.executor));
      // A scene without points has no frame that counts
      const bool has_points = open_.scene->superblock().points > 0;
      const LatticeMove move{has_points ? open_.scene->header().frame : frame, frame};
      chain.add(move_points(chain.last(), move));
      chain.add(merge_points(chain.last(), added));
    }
    if (open_.request.remove_duplicates) chain.add(unique_points(chain.last()));
  }

  /// Writes the pages of all groups of channels.
  /// @param marks  of the scan; null: there was none
  void write_attributes(const BuildPlan& plan, AttributeSorts& sorts, const PointMarks* marks,
                        std::uint64_t points, ContainerWriter& writer) {
    const std::vector<Channel>& channels = plan.meta.channels;
    const AttributePlan attributes =
        plan_of(open_.scene ? &open_.scene->meta().channels : nullptr, channels);
    std::uint8_t number = kFirstInputGroup;
    for (std::size_t group = 0; group < sorts.size(); ++group, ++number) {
      StreamChain chain(sorts.finish(group));
      join(chain, plan.frame,
           [&] { return container_attributes(*open_.scene, attributes, group); });
      if (marks) chain.add(marks->put_into(&chain.last(), number, channels));
      read_ahead_of(chain);
      write_attribute_pages(chain.last(), number, channels, points, writer);
    }
    if (!marks || channels.empty() || channels.back().group < number) return;
    const auto rest = marks->put_into(nullptr, number, channels);
    write_attribute_pages(*rest, number, channels, points, writer);
  }

  /// Builds the pages, from the checkpoint when there is one, and saves further checkpoints.
  Superblock build_from(PointStream& points, ContainerWriter& writer, ExternalSorter& sorter,
                        std::uint64_t (*needed)(std::uint64_t)) {
    if (!open_.resumption)
      return build_pages(points, writer, open_.request.tree, open_.executor, open_.progress);
    CheckpointSaver saver(*open_.resumption, writer, sorter, needed);
    Checkpoints checkpoints{.interval = open_.request.checkpoint_points,
                            .save = [&](const BuildPlace& at, std::vector<std::byte> state) {
                              saver.save(at, std::move(state));
                            }};
    if (!open_.resumption->checkpoint())
      return build_pages(points, writer, open_.request.tree, open_.executor, open_.progress,
                         checkpoints);
    StateReader state = open_.resumption->build_state();
    checkpoints.from = &state;
    return build_pages(points, writer, open_.request.tree, open_.executor, open_.progress,
                       checkpoints);
  }

  const OpenBuild& open_;
  ScanReport& scan_;
};

}  // namespace

Superblock build_sorted(const OpenBuild& open, SortedPoints& points,
                        const std::filesystem::path& path, ScanReport& scan) {
  return SortedBuild(open, scan).run(points, path);
}

}  // namespace ptc
