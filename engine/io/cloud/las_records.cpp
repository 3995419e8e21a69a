// Reads point records of LAS, and of LAZ by several threads.
//
// The chunks of a LAZ file stand for themselves, so each is decoded by a thread of its own. The
// next few jobs are in flight, in a ring, and are taken in the order of the file:
//
//   jobs   ... done | taken by next() | decoded | decoded | not begun ...
//                     \-------- ring of threads + 1 -------/
//
// A job is a chunk, or several small ones. A chunk whose records would take too much memory is no
// job: next() decodes it piece by piece in its own thread.
#include "engine/io/cloud/las_records.h"

#include <algorithm>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/io/laz/arithmetic.h"
#include "engine/io/laz/chunk_decoder.h"
#include "engine/io/laz/error.h"
#include "engine/io/laz/layout.h"

namespace ptc {
namespace {

constexpr std::size_t kBlockBytes = std::size_t{1} << 18;         // of LAS, read at once
constexpr std::uint64_t kSamplePlaces = 17;                       // the first chunk and 16 others
constexpr std::uint64_t kSampleRecords = kSamplePlaces << 13;     // at most, of all places
constexpr std::uint64_t kSmallJobBytes = std::uint64_t{1} << 20;  // jobs grow up to this
constexpr std::uint64_t kMaxJobBytes = std::uint64_t{1} << 24;    // of records
constexpr std::size_t kPieceRecords = 4096;                       // decoded between two checks
constexpr unsigned kMaxThreads = 8;
constexpr std::uint64_t kTablePosition = 8;  // bytes of the position of the chunk table

// Returns the greatest number of bytes that a chunk of these points can take: a symbol takes at
// most 2 bytes, and a byte of a record at most 2 symbols. Layers have 8 bytes each beyond their
// symbols.
std::uint64_t most_chunk_bytes(std::uint64_t points, std::size_t record_bytes) {
  return 1024 + 8 * points * record_bytes;
}

// Returns the start of the place-th of the places of a sample among `count` records.
std::uint64_t spread(std::uint64_t place, std::uint64_t count) {
  return count / kSamplePlaces * place + std::min(place, count % kSamplePlaces);
}

class PlainRecords : public LasRecordSource {
 public:
  PlainRecords(const InputFile& file, const LasHeader& header)
      : file_(file),
        header_(header),
        block_records_(std::max<std::uint64_t>(1, kBlockBytes / header.record_bytes)) {}

  LasBlock next() override {
    const LasBlock block = read(done_, block_records_);
    done_ += block.records.size() / header_.record_bytes;
    return block;
  }

  void sample(const LasLook& look) override {
    const std::uint64_t most = kSampleRecords / kSamplePlaces;
    std::uint64_t end = 0;  // of what was looked at
    for (std::uint64_t place = 0; place < kSamplePlaces; ++place) {
      std::uint64_t at = std::max(end, spread(place, header_.points));
      end = std::max(end, at + std::min(most, header_.points - at));
      for (; at < end; at += block_records_)
        look(read(at, std::min(block_records_, end - at)).records);
    }
  }

 private:
  LasBlock read(std::uint64_t first, std::uint64_t most) {
    const auto count = static_cast<std::size_t>(std::min(most, header_.points - first));
    const std::uint64_t offset = header_.points_offset + first * header_.record_bytes;
    buffer_.resize(count * header_.record_bytes);
    file_.read_at(offset, buffer_);
    return {buffer_, offset, header_.record_bytes};
  }

  const InputFile& file_;
  const LasHeader& header_;
  std::uint64_t block_records_;
  std::uint64_t done_ = 0;  // records that next() returned
  std::vector<std::byte> buffer_;
};

// Decodes chunks of one file. An error names the chunk.
class ChunkReader {
 public:
  ChunkReader(const InputFile& file, const laz::Layout& layout)
      : file_(file), layout_(layout), decoder_(laz::make_chunk_decoder(layout)) {}

  void start(const laz::Chunk& chunk) {
    chunk_ = chunk;
    if (chunk.bytes > most_chunk_bytes(chunk.points, layout_.record_bytes))
      refuse_las(file_, chunk.offset, "the chunk has more bytes than its points can take");
    bytes_.resize(static_cast<std::size_t>(chunk.bytes) + laz::kSlackBytes);
    file_.read_at(chunk.offset, std::span(bytes_).first(bytes_.size() - laz::kSlackBytes));
    naming_chunk([&] { decoder_->start(bytes_, chunk.points); });
  }

  // Decodes the next records of the chunk; `out` is not longer than what is left of them.
  void decode(std::span<std::byte> out) {
    const std::size_t piece = kPieceRecords * layout_.record_bytes;
    naming_chunk([&] {
      for (; !out.empty(); out = out.subspan(std::min(piece, out.size())))
        decoder_->decode(out.first(std::min(piece, out.size())));
    });
  }

  void finish() const {
    // Without a chunk table, the end of the only chunk is not known.
    if (layout_.compressor == laz::Compressor::pointwise) return;
    naming_chunk([&] { decoder_->finish(); });
  }

 private:
  template <class Call>
  void naming_chunk(const Call& call) const {
    try {
      call();
    } catch (const laz::LazError& error) {
      refuse_las(file_, chunk_.offset, std::string("chunk of compressed points: ") + error.what());
    }
  }

  const InputFile& file_;
  const laz::Layout& layout_;
  std::unique_ptr<laz::ChunkDecoder> decoder_;
  laz::Chunk chunk_;
  std::vector<std::byte> bytes_;
};

class CompressedRecords : public LasRecordSource {
 public:
  CompressedRecords(const InputFile& file, const LasHeader& header)
      : file_(file), layout_(read_layout(file, header)), chunks_(read_chunks(header)) {
    const unsigned threads = std::clamp(std::thread::hardware_concurrency(), 1U, kMaxThreads);
    for (unsigned i = 0; i <= threads; ++i) ring_.push_back(std::make_unique<Job>(file, layout_));
  }

  LasBlock next() override {
    if (large_left_ > 0) return next_piece();
    fill_ring();
    if (running_ == 0) {
      if (next_chunk_ == chunks_.size()) return {};
      Job& job = *ring_[taken_];  // its memory serves the large chunk
      large_ = chunks_[next_chunk_++];
      job.reader.start(large_);
      large_left_ = large_.points;
      return next_piece();
    }
    taken_ = (taken_ + 1) % ring_.size();
    --running_;
    Job& job = *ring_[taken_];
    job.done.get();
    return {job.records, job.chunks.front().offset, 0};
  }

  void sample(const LasLook& look) override {
    ChunkReader reader(file_, layout_);
    std::vector<std::byte> records;
    const std::uint64_t places = std::min<std::uint64_t>(kSamplePlaces, chunks_.size());
    for (std::uint64_t place = 0; place < places; ++place) {
      const laz::Chunk& chunk = chunks_[static_cast<std::size_t>(place * chunks_.size() / places)];
      reader.start(chunk);
      std::uint64_t left = std::min(chunk.points, kSampleRecords / places);
      while (left > 0) {
        const std::uint64_t count = std::min<std::uint64_t>(kPieceRecords, left);
        records.resize(static_cast<std::size_t>(count) * layout_.record_bytes);
        reader.decode(records);
        look(records);
        left -= count;
      }
    }
  }

 private:
  // Chunks that one thread decodes, and their records.
  struct Job {
    Job(const InputFile& file, const laz::Layout& layout)
        : record_bytes(layout.record_bytes), reader(file, layout) {}

    void run() {
      std::uint64_t bytes = 0;
      for (const laz::Chunk& chunk : chunks) bytes += chunk.points * record_bytes;
      records.resize(static_cast<std::size_t>(bytes));
      auto rest = std::span(records);
      for (const laz::Chunk& chunk : chunks) {
        const auto size = static_cast<std::size_t>(chunk.points * record_bytes);
        reader.start(chunk);
        reader.decode(rest.first(size));
        reader.finish();
        rest = rest.subspan(size);
      }
    }

    std::size_t record_bytes;
    ChunkReader reader;
    std::span<const laz::Chunk> chunks;
    std::vector<std::byte> records;
    std::future<void> done;  // last member: its destructor waits for the thread
  };

  static laz::Layout read_layout(const InputFile& file, const LasHeader& header) {
    const LasRecord* const record = header.find(kLaszipUser, kLaszipNumber);
    if (record == nullptr)
      refuse_las(file, 104, "the points are compressed, but there is no laszip record");
    const auto payload = read_las_payload(file, *record);
    if (!payload) refuse_las(file, record->offset, "the laszip record has more than 1 MiB");
    try {
      return laz::decode_layout(*payload, header.format, header.record_bytes);
    } catch (const laz::LazError& error) {
      refuse_las(file, record->offset, error.what());
    }
  }

  [[nodiscard]] std::vector<laz::Chunk> read_chunks(const LasHeader& header) const {
    if (header.points == 0) return {};
    const std::uint64_t start = header.points_offset;
    if (layout_.compressor == laz::Compressor::pointwise) {
      if (header.points > laz::kMaxChunkPoints)
        refuse_las(file_, 107, "more than 2^24 points in one stream are not supported");
      const std::uint64_t most = most_chunk_bytes(header.points, layout_.record_bytes);
      return {{start, std::min(file_.size() - start, most), header.points}};
    }

    // Find the chunk table: its position stands before the first chunk, or, when that is -1, at the
    // end of the file.
    std::uint64_t table = read_position(start);
    if (table == ~std::uint64_t{0}) table = read_position(file_.size() - kTablePosition);
    if (table < start + kTablePosition || table > file_.size()) {
      refuse_las(file_, start,
                 "the chunk table is not in the file; the writer may have been "
                 "interrupted before it wrote the table");
    }

    // Decode the table.
    const std::vector<std::byte> bytes = read_table(header, table);
    try {
      return laz::decode_chunk_table(bytes, layout_, header.points, start + kTablePosition, table);
    } catch (const laz::LazError& error) {
      refuse_las(file_, table, error.what());
    }
  }

  [[nodiscard]] std::uint64_t read_position(std::uint64_t offset) const {
    if (file_.size() < kTablePosition || offset > file_.size() - kTablePosition)
      refuse_las(file_, file_.size(), "the file ends before its compressed points");
    std::uint64_t position = 0;
    file_.read_at(offset, std::as_writable_bytes(std::span(&position, 1)));
    return position;
  }

  // Reads the file from the table on, as far as a table of that many chunks can go.
  [[nodiscard]] std::vector<std::byte> read_table(const LasHeader& header,
                                                  std::uint64_t offset) const {
    constexpr std::uint64_t kHeader = 8;
    constexpr std::uint64_t kMostPerChunk = 20;  // two integers of at most 32 bits and 2 symbols
    const std::uint64_t left = file_.size() - offset;
    std::uint32_t count = 0;
    if (left >= kHeader) file_.read_at(offset + 4, std::as_writable_bytes(std::span(&count, 1)));
    const std::uint64_t most = (offset - header.points_offset) / layout_.record_bytes;
    const std::uint64_t bytes =
        std::min(left, kHeader + 8 + kMostPerChunk * std::min<std::uint64_t>(count, most));
    std::vector<std::byte> table(static_cast<std::size_t>(bytes) + laz::kSlackBytes);
    file_.read_at(offset, std::span(table).first(static_cast<std::size_t>(bytes)));
    return table;
  }

  [[nodiscard]] std::uint64_t record_bytes_of(const laz::Chunk& chunk) const {
    return chunk.points * layout_.record_bytes;
  }

  // Begins jobs until the ring is full, the chunks are at their end, or a large one is next.
  void fill_ring() {
    while (running_ + 1 < ring_.size() && next_chunk_ < chunks_.size()) {
      std::uint64_t bytes = record_bytes_of(chunks_[next_chunk_]);
      if (bytes > kMaxJobBytes) return;
      std::size_t end = next_chunk_ + 1;
      while (end < chunks_.size() && bytes + record_bytes_of(chunks_[end]) <= kSmallJobBytes)
        bytes += record_bytes_of(chunks_[end++]);
      Job& job = *ring_[(taken_ + 1 + running_) % ring_.size()];
      job.chunks = std::span(chunks_).subspan(next_chunk_, end - next_chunk_);
      job.done = std::async(std::launch::async, [&job] { job.run(); });
      next_chunk_ = end;
      ++running_;
    }
  }

  LasBlock next_piece() {
    Job& job = *ring_[taken_];
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(kPieceRecords, large_left_));
    job.records.resize(count * layout_.record_bytes);
    job.reader.decode(job.records);
    large_left_ -= count;
    if (large_left_ == 0) job.reader.finish();
    return {job.records, large_.offset, 0};
  }

  const InputFile& file_;
  laz::Layout layout_;
  std::vector<laz::Chunk> chunks_;
  std::size_t next_chunk_ = 0;    // the first chunk that is in no job yet
  std::size_t taken_ = 0;         // place in the ring of the job whose records next() returned last
  std::size_t running_ = 0;       // jobs behind it in the ring that have begun
  laz::Chunk large_;              // the chunk that next() decodes in pieces
  std::uint64_t large_left_ = 0;  // points of it that next() has not returned
  std::vector<std::unique_ptr<Job>> ring_;  // last member: jobs refer to the others
};

}  // namespace

std::unique_ptr<LasRecordSource> open_las_records(const InputFile& file, const LasHeader& header) {
  if (header.compressed) return std::make_unique<CompressedRecords>(file, header);
  return std::make_unique<PlainRecords>(file, header);
}

}  // namespace ptc
