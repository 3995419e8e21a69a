// Each thread takes the next chunk and does what needs no other chunk. In the order of the chunks,
// their results then go to a file and their links to earlier chunks vote. A chunk that is done
// before its turn waits, while its thread takes another one:
//
//     thread 1   | fit, orient, result 4       | in order 4, 5 | fit, orient, result 7 ...
//     thread 2   | fit, orient, result 5 | fit, orient, result 6  | in order 6 | ...
#include "engine/scan/scan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>

#include "engine/base/memory_budget.h"
#include "engine/io/file/file.h"
#include "engine/scan/chunk_fit.h"
#include "engine/scan/islands.h"
#include "engine/scan/known_sides.h"
#include "engine/scan/orientation.h"
#include "engine/scan/place_result.h"
#include "engine/scan/scan_spool.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kReadRecords = std::size_t{1}
                                     << 13;  // records or results that are read at once
constexpr std::size_t kSpoolRecords = std::size_t{1} << 14;  // that are written at once
constexpr std::uint64_t kScatter = 10;  // quarters of an octave beyond the usual spacing, from
                                        // which a point that is on no surface is an outlier

/// A chunk, and what comes of it.
struct ChunkWork {
  std::uint64_t number = 0;
  ScanChunk chunk;
  ChunkPieces pieces;
  std::vector<PlaceResult> results;
};

std::size_t slots_for(std::size_t page_places) noexcept {
  constexpr std::size_t kHeld = 3 * kChunkPlaces;  // places in memory, pages being small
  return std::max<std::size_t>(48, kHeld / page_places);
}

std::uint64_t worker_bytes(std::size_t page_places) noexcept {
  constexpr std::uint64_t kOrientation = 160;  // of a place: patches and the graph between them
  return ChunkFitter::bytes(page_places, slots_for(page_places)) + kChunkPlaces * kOrientation;
}

constexpr std::uint64_t kWorkBytes = kChunkBytes + kChunkPlaces * sizeof(PlaceResult);

/// How many chunks are in memory.
struct ChunkCounts {
  std::size_t workers = 0;  ///< threads, each with a chunk
  std::size_t waiting = 0;  ///< chunks that may wait for their turn
};

/// Returns how many chunks memory allows. @param budget  charged with everything else
ChunkCounts count_chunks(const MemoryBudget& budget, std::size_t page_places, unsigned threads) {
  const std::uint64_t each = worker_bytes(page_places) + kWorkBytes;
  const std::uint64_t rest = budget.rest("a chunk of points", each);
  const std::uint64_t workers = std::min<std::uint64_t>(threads, rest / each);
  const std::uint64_t waiting = std::min(workers - 1, (rest - workers * each) / kWorkBytes);
  return {static_cast<std::size_t>(workers), static_cast<std::size_t>(waiting)};
}

/// Reads single results of places in ascending order, through a window of the file.
class ResultWindow {
 public:
  explicit ResultWindow(const TempFile& file, std::uint64_t places)
      : file_(file), places_(places) {}

  const PlaceResult& at(std::uint64_t place) {
    if (place < first_ || place >= first_ + window_.size()) {
      first_ = place;
      window_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(64, places_ - place)));
      file_.read_at(first_ * sizeof(PlaceResult), std::as_writable_bytes(std::span(window_)));
    }
    return window_[static_cast<std::size_t>(place - first_)];
  }

 private:
  const TempFile& file_;
  std::uint64_t places_;  ///< that have results
  std::uint64_t first_ = 0;
  std::vector<PlaceResult> window_;
};

/// The passes over the places, from the spool to their results.
class Completion {
 public:
  Completion(const ScanSpool& spool, const SkyView* sky, TempFile& results,
             const ScanOptions& options, const Frame& frame)
      : spool_(spool),
        sky_(sky),
        results_(results),
        sides_(frame, options.scanners, options.up, options.aerial),
        unit_(frame.unit()) {}

  void run(const ChunkCounts& counts, const Executor& executor, Progress& progress) {
    chunks_ = (spool_.places() + kChunkPlaces - 1) / kChunkPlaces;
    std::vector<ChunkWork> works(counts.workers + counts.waiting);
    for (ChunkWork& work : works) free_.push_back(&work);
    progress.begin("normals", spool_.places(), "points");
    executor.for_each(counts.workers, [&](std::size_t, unsigned) {
      try {
        work_on_chunks(progress);
      } catch (...) {
        fail();
        throw;
      }
    });
    progress.end();
  }

  Islands& islands() noexcept { return islands_; }
  const KnownSides& sides() const noexcept { return sides_; }

  /// Returns the octave of the usual spacing: half of the places have no greater one.
  [[nodiscard]] std::uint64_t usual_octave() const noexcept {
    std::uint64_t below = 0;
    for (std::uint64_t octave = 0; octave < octaves_.size(); ++octave) {
      below += octaves_[octave];
      if (2 * below >= spool_.places()) return octave;
    }
    return octaves_.size();
  }

 private:
  /// Takes chunks until none are left.
  void work_on_chunks(Progress& progress) {
    ChunkFitter fitter(spool_, slots_for(spool_.index().page_places()));
    OrientationRoom room;
    while (ChunkWork* const work = take()) {
      fitter.fit(work->number, work->chunk);
      orient_chunk(work->chunk, sides_, sky_, work->pieces, room);
      make_results(work->chunk, work->pieces, unit_, work->results);
      progress.advance(work->chunk.places.size());
      keep_in_turn(*work);
    }
  }

  /// Returns room for the next chunk, or null when there is none left.
  ChunkWork* take() {
    std::unique_lock lock(mutex_);
    freed_.wait(lock, [this] { return failed_ || taken_ == chunks_ || !free_.empty(); });
    if (failed_ || taken_ == chunks_) return nullptr;
    ChunkWork* const work = free_.back();
    free_.pop_back();
    work->number = taken_++;
    return work;
  }

  /// Keeps a chunk and those that waited for it, unless it must wait itself.
  void keep_in_turn(ChunkWork& done) {
    std::unique_lock lock(mutex_);
    waiting_.emplace(done.number, &done);
    if (keeping_) return;  // that thread will keep this chunk, too, when it is its turn
    keeping_ = true;
    for (auto first = waiting_.begin(); first != waiting_.end() && first->first == kept_;
         first = waiting_.begin()) {
      ChunkWork& work = *first->second;
      waiting_.erase(first);
      lock.unlock();
      keep(work);
      lock.lock();
      ++kept_;
      free_.push_back(&work);
      freed_.notify_all();
    }
    keeping_ = false;
  }

  /// Ends the work of all threads.
  void fail() {
    const std::lock_guard lock(mutex_);
    failed_ = true;
    freed_.notify_all();
  }

  /// Writes the results of a chunk, and lets its links to earlier chunks vote.
  void keep(ChunkWork& work) {
    ScanChunk& chunk = work.chunk;
    results_.write_at(chunk.first * sizeof(PlaceResult), std::as_bytes(std::span(work.results)));
    for (const PlaceResult& result : work.results) ++octaves_[result.octave];
    islands_.add_chunk(work.pieces);
    std::ranges::sort(chunk.outer, [](const OuterLink& a, const OuterLink& b) {
      return a.to != b.to ? a.to < b.to : a.from < b.from;
    });
    ResultWindow earlier(results_, chunk.first);
    std::vector<SignedGraph::Edge> votes;
    for (const OuterLink& link : chunk.outer) {
      const PlaceResult& other = earlier.at(link.to);
      const std::uint32_t a = islands_.piece(work.number, work.pieces.of[link.from]);
      const std::uint32_t b = islands_.piece(link.to / kChunkPlaces, other.piece);
      if (a == b) continue;
      const PlaceFit& fit = chunk.fits[link.from];
      const std::int64_t vote =
          vote_of({fit.normal, fit.noise},
                  {decode_octahedral(other.normal[0], other.normal[1]), fit.noise}, link.offset);
      if (vote != 0) votes.push_back({a, b, vote});
    }
    islands_.add_votes(votes);
  }

  const ScanSpool& spool_;
  const SkyView* sky_;
  TempFile& results_;
  KnownSides sides_;
  double unit_;
  Islands islands_;
  std::array<std::uint64_t, 256> octaves_{};  ///< places by PlaceResult::octave

  std::mutex mutex_;  ///< of what follows
  std::condition_variable freed_;
  std::vector<ChunkWork*> free_;
  std::map<std::uint64_t, ChunkWork*> waiting_;  ///< by number: chunks that are done
  std::uint64_t chunks_ = 0;                     ///< of the cloud
  std::uint64_t taken_ = 0, kept_ = 0;           ///< chunks
  bool keeping_ = false;                         ///< a thread keeps a chunk
  bool failed_ = false;                          ///< a thread has thrown
};

/// Merges records and results.
class CompletedStream final : public ScanStream {
 public:
  CompletedStream(std::unique_ptr<ScanSpool> spool, std::unique_ptr<TempFile> results,
                  std::unique_ptr<Islands> islands, std::uint64_t usual_octave, float usual_radius,
                  bool radii, ScanReport& report)
      : spool_(std::move(spool)),
        results_(std::move(results)),
        islands_(std::move(islands)),
        usual_octave_(usual_octave),
        usual_radius_(usual_radius),
        radii_(radii),
        report_(report) {}

  std::size_t next(std::span<PointRecord> out) override {
    const auto count = static_cast<std::size_t>(
        std::min<std::uint64_t>({out.size(), kReadRecords, spool_->records() - at_}));
    spool_->read_records(at_, out.first(count));
    marks_.assign(count, 0);
    for (std::size_t i = 0; i < count; ++i) marks_[i] = complete(out[i]);
    at_ += count;
    return count;
  }

  [[nodiscard]] std::span<const std::uint8_t> marks() const noexcept override { return marks_; }

 private:
  /// Completes the next record. @return its mark
  std::uint8_t complete(PointRecord& record) {
    std::uint8_t mark = 0;
    if (places_ > 0 && record.key == last_) {
      mark = kDuplicate;
    } else {
      advance();
      last_ = record.key;
    }
    const PlaceResult& result = window_[static_cast<std::size_t>(places_ - 1 - first_)];
    bool flip = false;
    if ((record.flags & kUnknownNormal) != 0) {
      flip = islands_->flipped(islands_->piece((places_ - 1) / kChunkPlaces, result.piece));
      record.normal = flip ? flip_octahedral(result.normal) : result.normal;
    }
    record.flags = 0;
    const float given = record.radius;
    if (radii_ && given == 0) {
      record.radius = result.radius;
      ++report_.radii;
    }
    const bool scattered =
        (result.facts & kScattered) != 0 && result.octave > usual_octave_ + kScatter;
    if (scattered || (result.facts & kIsolated) != 0) {
      mark |= kOutlier;
      // The distance to its neighbours says nothing of how large an outlier is
      if (radii_ && given == 0) record.radius = std::min(record.radius, usual_radius_);
    }
    report_.outliers += mark & kOutlier;
    mark |= static_cast<std::uint8_t>(result.rise[flip ? 1 : 0] << kRiseShift);
    report_.alone += radii_ && record.radius == 0;
    return mark;
  }

  /// Goes on to the next place.
  void advance() {
    if (places_++ != first_ + window_.size()) return;
    first_ = places_ - 1;
    window_.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(kReadRecords, spool_->places() - first_)));
    results_->read_at(first_ * sizeof(PlaceResult), std::as_writable_bytes(std::span(window_)));
  }

  std::unique_ptr<ScanSpool> spool_;
  std::unique_ptr<TempFile> results_;
  std::unique_ptr<Islands> islands_;
  std::uint64_t usual_octave_;
  float usual_radius_;  ///< scene units
  bool radii_;
  ScanReport& report_;
  std::uint64_t at_ = 0;      ///< number of the next record
  std::uint64_t places_ = 0;  ///< places of the records before it
  MortonKey last_;            ///< of the record before it
  std::uint64_t first_ = 0;   ///< place of the window's first result
  std::vector<PlaceResult> window_;
  std::vector<std::uint8_t> marks_;
};

/// Writes all points to the spool, and shows them to the view of the sky, if there is one.
void fill(ScanSpool& spool, SkyView* sky, PointStream& sorted, const Executor& executor,
          Progress& progress, ScanReport& report) {
  progress.begin("spool", 0, "points");
  std::vector<PointRecord> block(kSpoolRecords);
  while (const std::size_t count = sorted.next(block)) {
    const auto records = std::span<const PointRecord>(block).first(count);
    executor.for_each(3, [&](std::size_t part, unsigned) {
      if (part == 0) spool.add_records(records);
      if (part == 1) spool.add_places(records);
      if (part == 2 && sky != nullptr) {
        for (const PointRecord& record : records) sky->add(position_of(record.key));
      }
    });
    for (const PointRecord& record : records)
      report.normals += (record.flags & kUnknownNormal) != 0;
    progress.advance(count);
  }
  spool.finish();
  progress.end();
  report.points = spool.records();
  report.duplicates = spool.records() - spool.places();
}

}  // namespace

std::unique_ptr<ScanStream> complete_scan(PointStream& sorted, const Frame& frame,
                                          const ScanOptions& options, const Executor& executor,
                                          Progress& progress, ScanReport& report) {
  report = {};
  // Write the points to disk, with an index that takes an eighth of the memory at most.
  const std::uint64_t index_bytes = std::clamp<std::uint64_t>(
      options.memory_bytes / 8, std::uint64_t{1} << 16, std::uint64_t{1} << 28);
  auto spool = std::make_unique<ScanSpool>(options.temp_dirs, index_bytes);
  // The sky tells sides where no scanner does.
  const auto sky = options.scanners.empty() ? std::make_unique<SkyView>() : nullptr;
  fill(*spool, sky.get(), sorted, executor, progress, report);
  // Work on as many chunks at once as memory allows.
  MemoryBudget budget(options.memory_bytes, "completing a scan");
  budget.charge("the index of points", index_bytes);
  if (sky) budget.charge("the view of the sky", SkyView::kBytes);
  budget.charge("buffers", std::uint64_t{2} << 20);
  const ChunkCounts counts = count_chunks(budget, spool->index().page_places(), executor.threads());
  auto results = std::make_unique<TempFile>(options.temp_dirs.back());
  Completion completion(*spool, sky.get(), *results, options, frame);
  if (sky && report.normals > 0) sky->finish(completion.sides().up());
  completion.run(counts, executor, progress);
  spool->discard_places();
  // Settle the sides.
  auto islands = std::make_unique<Islands>(std::move(completion.islands()));
  budget.charge("normals of unknown side", islands->bytes());
  budget.require();
  islands->solve(completion.sides().up());
  report.islands = islands->count();
  const std::uint64_t octave = completion.usual_octave();
  const auto radius = static_cast<float>(frame.unit() * length_of_octave(octave));
  return std::make_unique<CompletedStream>(std::move(spool), std::move(results), std::move(islands),
                                           octave, radius, options.radii, report);
}

}  // namespace ptc
