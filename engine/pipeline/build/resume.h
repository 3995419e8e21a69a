// The files from which an interrupted build can be continued (build_container.h,
// BuildRequest::resume).
//
//   OUT.resume                the manifest: the request and, once all points are partitioned, the
//                             table of the spill files
//   OUT.resume-pages          the unfinished container
//   OUT.resume-at             the last checkpoint
//   TEMP/OUT.resume-spill-*   the points by range of keys, in every directory for temporary files
//
// Each file is on the disk, whole, before another one refers to it:
//
//   spill files  -->  manifest  -->  pages  -->  checkpoint  -->  blocks of spill files freed
//                     (keep)         (sync)      (save)           (discard_before)
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/build_pages.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/scan/scan.h"
#include "engine/sort/external_sort.h"
#include "engine/store/writer.h"
#include "format/schema.h"

namespace ptc {

/// Everything that the container is made with besides its points; known once all points have
/// entered the sort.
struct BuildPlan {
  Frame frame;
  Uuid uuid{};
  Meta meta;
  /// How the scan is completed, without its resources; empty when all inputs give normals and
  /// radii. It fills the channels of add_marks().
  std::optional<ScanOptions> scan;
  bool emits = false;  ///< at least one point may emit light

  /// Returns the bytes of a point in the container.
  [[nodiscard]] std::uint8_t point_bytes() const noexcept {
    return emits ? kEmittingPointBytes : kPointBytes;
  }
};

/// A moment of a build from which another process can continue it.
struct Checkpoint {
  BuildPlace place;
  WriterState writer;
  std::vector<std::byte> build;  ///< state of build_pages(), for Checkpoints::from
};

/// The files of one build that can be continued: opens those of an interrupted build, and writes
/// new ones. Until keep() is called, the destructor removes all of them; afterwards they stay until
/// remove().
class Resumption {
 public:
  /// Reopens the files of an interrupted build of the same request, or begins new ones. Files of a
  /// build that was interrupted before the end of its sort are removed.
  /// @throws RequestError when the request has a mesh in memory;
  ///         DataError when a file is damaged or belongs to another request: the text says what
  ///         differs;
  ///         std::system_error, also when another process is building the same target
  Resumption(const BuildRequest& request, const std::filesystem::path& target);
  Resumption(const Resumption&) = delete;
  Resumption& operator=(const Resumption&) = delete;

  /// The path of the unfinished container.
  [[nodiscard]] const std::filesystem::path& partial() const noexcept { return pages_; }
  /// The paths of the spill files of the points, for SortOptions::kept_files.
  [[nodiscard]] const std::vector<std::filesystem::path>& spills() const noexcept {
    return spills_;
  }
  /// Names the spill files of the attributes. To be called before any of them is written.
  /// @param groups  number of sorts of attributes
  void add_spills(std::size_t groups);
  /// The paths of the spill files of all sorts of attributes, as many for each as spills() has.
  [[nodiscard]] std::span<const std::filesystem::path> attribute_spills() const noexcept {
    return attribute_spills_;
  }

  /// The plan of the interrupted build; empty when the points must be sorted from the beginning.
  [[nodiscard]] const std::optional<BuildPlan>& plan() const noexcept { return plan_; }
  /// Returns whether an interrupted build was found that had not finished its sort.
  [[nodiscard]] bool sort_unfinished() const noexcept { return sort_unfinished_; }
  /// Returns the state from which an ExternalSorter reopens the spill files of the points, and
  /// AttributeSorts those of the attributes. @pre plan()
  [[nodiscard]] StateReader sorter_state() const { return {sorter_, manifest_.string()}; }
  /// The checkpoint to continue from; empty when the build starts at the first sorted point.
  [[nodiscard]] const std::optional<Checkpoint>& checkpoint() const noexcept { return checkpoint_; }
  /// Returns the state of build_pages() at the checkpoint. @pre checkpoint()
  [[nodiscard]] StateReader build_state() const { return {checkpoint_->build, at_.string()}; }

  /// Makes all files outlive this object. To be called once, when all points have entered the sort.
  void keep(const BuildPlan& plan, ExternalSorter& sorter, AttributeSorts& attributes);
  /// Returns a checkpoint as it lies on the disk.
  [[nodiscard]] std::vector<std::byte> encode(const Checkpoint& checkpoint) const;
  /// Replaces the checkpoint on the disk. @param checkpoint  encoded
  void save(std::span<const std::byte> checkpoint) const;
  /// Refuses to continue from damaged files.
  /// @throws DataError with the text of `error`, followed by the files to remove for a new start
  [[noreturn]] void refuse(const DataError& error) const;
  /// Removes all files. To be called when the container is published.
  void remove() noexcept;

 private:
  void load_manifest();
  void load_checkpoint();
  void begin();
  void write_manifest(const std::vector<std::byte>& sorted) const;

  std::filesystem::path manifest_, pages_, at_;
  std::vector<std::filesystem::path> spills_, attribute_spills_;
  std::string request_;
  std::vector<std::byte> sorter_;
  bool sort_unfinished_ = false;
  std::optional<BuildPlan> plan_;
  std::optional<Checkpoint> checkpoint_;
  std::uint64_t id_ = 0;  ///< hash of the plan and the sorter's state; checkpoints record it
  std::unique_ptr<FileLock> lock_;
  /// Removes all files with this object, until keep() releases them.
  std::vector<std::unique_ptr<TemporaryName>> unsorted_;
};

/// Saves checkpoints of a build on a thread of its own, while the build continues.
class CheckpointSaver {
 public:
  /// @param first_needed  index of the first sorted point that a build needs to continue at a given
  ///                      point; the disk blocks of earlier points are freed
  /// All arguments must outlive this.
  CheckpointSaver(const Resumption& resumption, ContainerWriter& writer, ExternalSorter& sorter,
                  std::uint64_t (*first_needed)(std::uint64_t));
  /// Waits for the checkpoint that is being saved; its error is lost.
  ~CheckpointSaver();
  CheckpointSaver(const CheckpointSaver&) = delete;
  CheckpointSaver& operator=(const CheckpointSaver&) = delete;

  /// Waits for the previous checkpoint, then starts to save this one.
  /// @throws whatever went wrong with the previous one
  void save(const BuildPlace& place, std::vector<std::byte> build);

 private:
  const Resumption& resumption_;
  ContainerWriter& writer_;
  ExternalSorter& sorter_;
  std::uint64_t (*first_needed_)(std::uint64_t);
  std::future<void> saving_;
};

}  // namespace ptc
