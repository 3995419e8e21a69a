// The points of the inputs are sent to ranges of the curve, and each part is sorted and built.
#include "engine/pipeline/farm/build_tasks.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/base/memory_budget.h"
#include "engine/io/cloud/record.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/rounding.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/build_record.h"
#include "engine/pipeline/build/placed_points.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/build/resume.h"
#include "engine/pipeline/farm/range_sorts.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/scene/procedural/city.h"
#include "engine/store/writer.h"

namespace ptc {
namespace {

constexpr std::size_t kSurfelBlock = 1 << 14;  // surfels read from a source at once
constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();

constexpr char kCapOfRun[] = "run.memory_bytes", kCapOfPlan[] = "task_memory";

/// Returns the bytes that a route has for its ranges.
/// @param points  of its input
/// @param field   as for MemoryBudget
std::uint64_t ranges_bytes(const FarmPlan& plan, std::uint64_t points, std::uint64_t cap,
                           const char* field) {
  MemoryBudget budget(cap, "a route of this plan", field);
  budget.charge("buffers", kBufferBytes);
  const std::size_t ranges = plan.borders.size() + 1;
  const RangeRow row = plan.row();
  const std::uint64_t least = RangeWriter::least_memory(ranges, row);
  // A half of what is left gives blocks of this size at least, and so this many
  const std::uint64_t block = std::max<std::uint64_t>(
      RangeWriter::block_points(ranges, row, std::max(budget.left() / 2, least)), 1);
  budget.charge("the table of a route", RangeWriter::kTableBytes * (points / block + ranges));
  return budget.rest("the ranges", least);
}

/// Returns the bytes that a part has for its sorts.
std::uint64_t sorts_bytes(const FarmPlan& plan, std::uint64_t cap, unsigned threads,
                          const char* field) {
  MemoryBudget budget(cap, "a part of this plan", field);
  budget.charge("buffers", kBufferBytes);
  budget.charge("pages that are written",
                ContainerWriter::writing_bytes(plan.request.page_shift, threads));
  budget.charge("node pages that wait", held_pages_bytes(plan.request.page_shift));
  return budget.rest("the sort", kMinSortBytes * (plan.row().group_bytes.size() + 1));
}

/// Sends the points of one input to their ranges.
class Route {
 public:
  Route(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress)
      : plan_(plan),
        number_(task.number),
        executor_(run.threads),
        progress_(progress),
        attributes_(plan.attributes()),
        values_(attributes_.groups()),
        writer_(task.outputs.at(0), plan.id, plan.borders, plan.row(),
                ranges_bytes(plan, plan.inputs[task.number].points, run.memory_bytes, kCapOfRun)) {}

  void run() {
    const FarmInput& input = plan_.inputs[number_];
    progress_.begin("route", input.points, "points");
    if (input.path.empty()) {
      if (input.blocks.end > city_blocks(plan_.request.city_points))
        throw DataError(plan_.file.string() + ": an input has blocks that the city lacks");
      feed(*make_city(plan_.request.city_points, input.blocks), AttributePlan::kNoInput, kAll);
    } else {
      const std::vector<InputState>& states = plan_.files.at(input.path);
      require_unchanged(states);
      for (std::size_t i = 0; i < number_; ++i) points_ += plan_.inputs[i].points;
      const PointFile file = open_placed_points(input.path, plan_.request.selection, {});
      require_planned(file.info.channels == input.channels);
      require_planned(input.first == 0 || file.source->skip(input.first));
      const std::uint64_t before = points_;
      feed(*file.source, input.channels.empty() ? AttributePlan::kNoInput : input_number(),
           plan_.is_divided(number_) ? input.points : kAll);
      require_planned(points_ - before == input.points);
      require_unchanged(states);  // nor while it was read
    }
    writer_.finish();
    progress_.end();
  }

 private:
  /// Refuses an input that is not as the plan says.
  void require_planned(bool holds) const {
    if (holds) return;
    throw DataError(plan_.inputs[number_].path.string() +
                    ": the file changed since it was planned: plan again");
  }

  /// Returns the number of the input's file among those that have channels.
  [[nodiscard]] std::size_t input_number() const {
    const auto of_file = [](const FarmInput& input) {
      return !input.channels.empty() && input.first == 0;
    };
    const auto begin = plan_.inputs.begin();
    const auto files =
        std::count_if(begin, begin + static_cast<std::ptrdiff_t>(number_ + 1), of_file);
    return static_cast<std::size_t>(files - 1);
  }

  /// @param most  points that are taken
  void feed(PointSource& source, std::size_t input, std::uint64_t most) {
    for (std::uint64_t left = most; left > 0;) {
      const std::size_t count = source.next(std::span(surfels_).first(
          static_cast<std::size_t>(std::min<std::uint64_t>(left, surfels_.size()))));
      if (count == 0) break;
      left -= count;
      const auto records = std::span(records_).first(count);
      executor_.for_ranges(count, 1 << 11, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) records[i] = to_record(surfels_[i], plan_.frame);
      });
      for (std::size_t group = 0; group < values_.size(); ++group) {
        values_[group].resize(count);
        attributes_.fill(input, source.attributes(), points_, group, values_[group]);
      }
      writer_.add(records, values_);
      points_ += count;
      progress_.advance(count);
    }
  }

  const FarmPlan& plan_;
  std::size_t number_;
  const ThreadPool executor_;
  Progress& progress_;
  AttributePlan attributes_;
  std::vector<std::vector<PointRecord>> values_;
  RangeWriter writer_;
  std::vector<Surfel> surfels_ = std::vector<Surfel>(kSurfelBlock);
  std::vector<PointRecord> records_ = std::vector<PointRecord>(kSurfelBlock);
  std::uint64_t points_ = 0;  ///< number of the next point among all inputs
};

/// Refuses points that rounding has moved out of their part: then the part before would have to
/// know them (spec/parts.md#writing).
class WithinPart : public PointStream {
 public:
  WithinPart(PointStream& points, const MortonKey& first, std::string name)
      : points_(points), first_(first), name_(std::move(name)) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = points_.next(out);
    if (count > 0 && out[0].key < first_) {
      throw DataError(name_ +
                      ": a disc is so wide that rounding moves its point to the part "
                      "before: plan a profile that does not round");
    }
    return count;
  }

 private:
  PointStream& points_;
  MortonKey first_;
  std::string name_;
};

/// Sorts and builds a part of all inputs.
class Part {
 public:
  Part(const FarmPlan& plan, const FarmTask& task, const RunOptions& run, Progress& progress)
      : plan_(plan),
        number_(task.number),
        target_(task.outputs.at(0)),
        run_(run),
        fit_(threads_that_fit(run,
                              [&](unsigned threads) {
                                return sorts_bytes(plan, run.memory_bytes, threads, kCapOfRun);
                              })),
        executor_(fit_.threads),
        progress_(progress),
        attributes_(plan.attributes()),
        row_(plan.row()),
        digests_(attributes_.groups() + 1) {}

  /// Builds the part. @return  whether it has points; one without has no file
  [[nodiscard]] bool run() {
    const std::uint64_t points = find();
    if (points == 0) {  // a scene has no part without points
      remove_part(target_);
      return false;
    }
    // Two sorts of the points of a range share as much memory as each sort of values has
    sort_ = {.memory_bytes = fit_.bytes / (attributes_.groups() + 1),
             .temp_dirs = temp_dirs(run_, target_),
             .expected = points,
             .emits = plan_.emits};
    std::vector<MortonKey> keys;
    if (attributes_.groups() > 0) keys = sample(first_, end_, points, sort_.memory_bytes);
    sorts_.emplace(attributes_, sort_, std::span<const std::filesystem::path>(), executor_, keys);
    sort_.expected = 0;
    for (std::size_t range = first_; range < end_; ++range)
      sort_.expected = std::max(sort_.expected, points_of(range));
    if (end_ - first_ > 1) sort_.memory_bytes /= 2;
    progress_.begin("build", points, "points");
    build();
    progress_.end();
    return true;
  }

 private:
  /// The points of the part that a task has routed.
  struct Routed {
    std::filesystem::path path;
    std::vector<RangeBlock> blocks;  ///< by range

    /// Returns those of some ranges.
    [[nodiscard]] std::span<const RangeBlock> of(std::size_t first, std::size_t end) const {
      return {std::ranges::lower_bound(blocks, first, {}, &RangeBlock::range),
              std::ranges::lower_bound(blocks, end, {}, &RangeBlock::range)};
    }
  };

  /// Finds the points of the part in the files of the routes.
  /// @return  their number
  [[nodiscard]] std::uint64_t find() {
    std::uint64_t points = 0;
    for (std::size_t i = 0; i < plan_.inputs.size(); ++i) {
      const std::filesystem::path path = plan_.output({TaskKind::route}, i);
      RangeBlocks own = read_ranges(path, plan_.id, row_, first_, end_);
      for (const RangeBlock& block : own.blocks) points += block.points;
      for (std::size_t set = 0; set < digests_.size(); ++set)
        digests_[set] = sum(digests_[set], own.digests[set]);
      if (!own.blocks.empty()) routes_.push_back({path, std::move(own.blocks)});
    }
    return points;
  }

  /// Returns the number of points of a range.
  [[nodiscard]] std::uint64_t points_of(std::size_t range) const {
    std::uint64_t points = 0;
    for (const Routed& route : routes_) {
      for (const RangeBlock& block : route.of(range, range + 1)) points += block.points;
    }
    return points;
  }

  /// Adds the points of the next range that has some to a sort, and their values to theirs.
  /// @return  whether there was one
  [[nodiscard]] bool read_range(ExternalSorter& sorter) {
    std::uint64_t points = 0;
    while (first_ < end_ && (points = points_of(first_)) == 0) ++first_;
    if (first_ == end_) return false;
    sorter.restart(points, sample(first_, first_ + 1, points, sort_.memory_bytes));
    std::vector<PointRecord> values;
    for (const Routed& route : routes_) {
      const auto blocks = route.of(first_, first_ + 1);
      if (blocks.empty()) continue;
      RangeReader reader(route.path, row_, blocks);
      while (reader.next()) {
        sorter.add(reader.block());
        for (std::size_t group = 0; group < sorts_->size(); ++group) {
          reader.values(group, values);
          sorts_->add(group, values);
        }
      }
    }
    ++first_;
    return true;
  }

  /// Returns keys of points that are spread over some ranges, for the splitters of a sort.
  /// @param memory_bytes  of the sort; none where they all fit
  [[nodiscard]] std::vector<MortonKey> sample(std::size_t first, std::size_t end,
                                              std::uint64_t points,
                                              std::uint64_t memory_bytes) const {
    constexpr std::uint64_t kPieces = 2048;
    if (points * 3 * sizeof(PointRecord) <= memory_bytes) return {};
    std::vector<MortonKey> keys;
    std::uint64_t ahead = 0;
    for (const Routed& route : routes_) {
      RangeReader reader(route.path, row_, route.of(first, end));
      ahead = reader.sample_keys(ahead, points / kPieces + 1, keys);
    }
    return keys;
  }

  void build() {
    // Chain the streams
    const MortonKey first = number_ > 0 ? plan_.cuts[number_ - 1] : MortonKey{};
    const auto read = [this](ExternalSorter& sorter) { return read_range(sorter); };
    RangeSorts sorted(sort_, read, executor_);
    PointStream* points = &sorted;
    std::unique_ptr<PointStream> unique, rounded;
    if (plan_.request.remove_duplicates) {
      unique = unique_points(*points);
      points = unique.get();
    }
    if (is_rounded(plan_.request.profile)) {
      rounded = round_points(*points, plan_.frame.unit(), executor_);
      points = rounded.get();
    }
    WithinPart within(*points, first, target_.string());

    // Write the pages, the values, and the edges of the tree
    BuildPlan made{.frame = plan_.frame, .meta = plan_.meta, .emits = plan_.emits};
    ContainerWriter writer(
        target_, {.page_shift = plan_.request.page_shift,
                  .codec = codec_of(plan_.request.profile),
                  .uuid = content_uuid(digests_[0], std::span(digests_).subspan(1), plan_.frame,
                                       plan_.request, plan_.meta, {}),
                  .frame = plan_.frame,
                  .point_bytes = made.point_bytes()});
    TreeEdges edges;
    const Superblock superblock =
        build_pages(within, writer, plan_.request.tree, executor_, progress_, {}, &edges);
    write_values(superblock.points, writer);
    static_cast<void>(writer.finish(plan_.meta, superblock));
    write_edges(target_, edges);
  }

  void write_values(std::uint64_t points, ContainerWriter& writer) {
    for (std::size_t group = 0; group < sorts_->size(); ++group) {
      const auto sorted = sorts_->finish(group);
      std::unique_ptr<PointStream> unique;
      if (plan_.request.remove_duplicates) unique = unique_points(*sorted);
      write_attribute_pages(unique ? *unique : *sorted,
                            static_cast<std::uint8_t>(kFirstInputGroup + group),
                            plan_.meta.channels, points, writer);
    }
  }

  const FarmPlan& plan_;
  std::size_t number_;
  std::filesystem::path target_;
  const RunOptions& run_;
  ThreadsThatFit fit_;  ///< with the bytes of the sorts
  const ThreadPool executor_;
  Progress& progress_;
  AttributePlan attributes_;
  RangeRow row_;
  std::size_t first_ = plan_.ranges_of(number_)[0];  ///< range that is read next
  const std::size_t end_ = plan_.ranges_of(number_)[1];
  std::vector<Routed> routes_;          ///< those that have points of the part
  std::vector<RecordsDigest> digests_;  ///< of the points, and of the values of each group
  SortOptions sort_;                    ///< of the points of a range
  std::optional<AttributeSorts> sorts_;
};

}  // namespace

void require_task_memory(const FarmPlan& plan, std::uint64_t memory_bytes) {
  std::uint64_t most = 0;
  for (const FarmInput& input : plan.inputs) most = std::max(most, input.points);
  static_cast<void>(ranges_bytes(plan, most, memory_bytes, kCapOfPlan));
  static_cast<void>(sorts_bytes(plan, memory_bytes, 1, kCapOfPlan));
}

void route_input(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
                 Progress& progress) {
  Route(plan, task, run, progress).run();
}

bool build_part(const FarmPlan& plan, const FarmTask& task, const RunOptions& run,
                Progress& progress) {
  return Part(plan, task, run, progress).run();
}

}  // namespace ptc
