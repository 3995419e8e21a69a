// A build that goes on where another ended (engine/ptc.h, BuildRequest::resume).
//
//   OUT.resume        what is built from what; once all points are sorted by range, also the table
//   of the temporary files OUT.resume-pages  the container as far as it got OUT.resume-at     the
//   last checkpoint TEMP/OUT.resume-spill-*  the sorted ranges, in every --temp directory
//
// Each is on the disk, whole, before the next stands on it: the ranges before the table, the pages
// before the checkpoint, the checkpoint before the ranges that it no longer needs are given back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/build_pages.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/sort/external_sort.h"
#include "engine/store/writer.h"
#include "format/schema.h"

namespace ptc {

/// What a container is made with, known once all points are there.
struct BuildPlan {
  Frame frame;
  Uuid uuid{};
  Meta meta;
  bool estimate_radii = false;
};

/// A moment to go on from.
struct Checkpoint {
  BuildPlace place;
  WriterState writer;
  std::vector<std::byte> build;  ///< for Checkpoints::from
};

/// What is kept of a build, and for whom. Until the points are sorted nothing outlives it, unless
/// the process is killed.
class Resumption {
 public:
  /// Takes up what an earlier build of the same request left; what that did not bring to the end of
  /// the sort goes.
  /// @throws DataError when what is there is damaged, or of another request: the text names what
  /// differs;
  ///         std::system_error, also when another process is at it
  Resumption(const BuildRequest& request, const std::filesystem::path& target);
  Resumption(const Resumption&) = delete;
  Resumption& operator=(const Resumption&) = delete;

  /// The container's name while it is unfinished.
  [[nodiscard]] const std::filesystem::path& partial() const noexcept { return pages_; }
  /// Names for SortOptions::kept_files.
  [[nodiscard]] const std::vector<std::filesystem::path>& spills() const noexcept {
    return spills_;
  }

  /// What was kept once the points were sorted; empty: they must be sorted.
  [[nodiscard]] const std::optional<BuildPlan>& plan() const noexcept { return plan_; }
  /// Of the sorter that sorted them.
  [[nodiscard]] StateReader sorter_state() const { return {sorter_, manifest_.string()}; }
  /// From which to go on; empty: from the first point on.
  [[nodiscard]] const std::optional<Checkpoint>& checkpoint() const noexcept { return checkpoint_; }
  [[nodiscard]] StateReader build_state() const { return {checkpoint_->build, at_.string()}; }

  /// From now on, all points sorted, what there is stays.
  void keep(const BuildPlan& plan, ExternalSorter& sorter);
  void save(const Checkpoint& checkpoint) const;
  /// Tells what to remove to start anew. @throws DataError with it behind what `error` says
  [[noreturn]] void refuse(const DataError& error) const;
  /// Removes all, once the container is published.
  void remove() noexcept;

 private:
  void load_manifest();
  void load_checkpoint();
  void begin();
  void write_manifest(const std::vector<std::byte>& sorted) const;

  std::filesystem::path manifest_, pages_, at_;
  std::vector<std::filesystem::path> spills_;
  std::string request_;
  std::vector<std::byte> sorter_;
  std::optional<BuildPlan> plan_;
  std::optional<Checkpoint> checkpoint_;
  std::uint64_t id_ = 0;  ///< of what was sorted: a checkpoint belongs to it
  std::unique_ptr<FileLock> lock_;
  std::vector<std::unique_ptr<TemporaryName>>
      unsorted_;  ///< all files, until what is in them is worth keeping
};

/// Saves checkpoints of a build while it goes on.
class CheckpointSaver {
 public:
  /// @param first_needed  of the points before which a build at some point needs none
  /// All must outlive this.
  CheckpointSaver(const Resumption& resumption, ContainerWriter& writer, ExternalSorter& sorter,
                  std::uint64_t (*first_needed)(std::uint64_t));
  /// Waits for the one that is on its way.
  ~CheckpointSaver();
  CheckpointSaver(const CheckpointSaver&) = delete;
  CheckpointSaver& operator=(const CheckpointSaver&) = delete;

  /// Waits for the one before. @throws what went wrong with it
  void save(const BuildPlace& place, std::vector<std::byte> build);

 private:
  const Resumption& resumption_;
  ContainerWriter& writer_;
  ExternalSorter& sorter_;
  std::uint64_t (*first_needed_)(std::uint64_t);
  std::future<void> saving_;
};

}  // namespace ptc
