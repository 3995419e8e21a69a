// A file is cut into blocks of RecordFile::kBlock records, and kTransfers buffers take the blocks
// in turn. Reader and writer both stay ahead of the caller:
//
//   blocks of the file   | 0 | 1 | 2 | 3 | 4 | 5 | ...      block b is in buffer b mod kTransfers
//   RecordWriter          written by threads   ^ filled by the caller
//   RecordReader           ^ used by the caller  2, 3, 4 read by threads
#include "tools/bench/scenes/record_file.h"

#include <algorithm>
#include <random>

#include "engine/base/background.h"
#include "engine/io/cloud/record.h"
#include "engine/scene/procedural/city.h"

namespace ptc::bench {
namespace {

constexpr std::size_t kBlockBytes = RecordFile::kBlock * sizeof(PointRecord);

std::uint64_t blocks_of(const RecordFile& file) noexcept {
  return (file.records() + RecordFile::kBlock - 1) / RecordFile::kBlock;
}

}  // namespace

std::size_t RecordFile::block_bytes(std::uint64_t block) const noexcept {
  const std::uint64_t left = bytes() - block * kBlockBytes;
  return direct_blocks(static_cast<std::size_t>(std::min<std::uint64_t>(left, kBlockBytes)));
}

void RecordFile::fill(std::uint64_t records) {
  const Arena noise(kBlockBytes);
  std::mt19937_64 random(1);
  const std::span words(reinterpret_cast<std::uint64_t*>(noise.data()),
                        kBlockBytes / sizeof(std::uint64_t));
  std::ranges::generate(words, random);
  records_ = records;
  for_each_transfer(blocks_of(*this), [&](std::uint64_t block, std::size_t) {
    file_->write_at(block * kBlockBytes, {noise.data(), block_bytes(block)});
  });
}

void RecordFile::copy_to(RecordFile& other, std::uint64_t most) const {
  most = std::min(most, bytes());
  const Arena buffers(kTransfers * kBlockBytes);
  for_each_transfer(blocks_of(*this), [&](std::uint64_t block, std::size_t copy) {
    const std::span<std::byte> buffer(buffers.data() + copy * kBlockBytes, block_bytes(block));
    const std::uint64_t begin = block * kBlockBytes;
    file_->read_at(begin, buffer);
    if (begin < most)
      other.file_->write_at(begin,
                            buffer.first(std::min(buffer.size(), direct_blocks(most - begin))));
  });
  other.records_ = most / sizeof(PointRecord);
}

RecordWriter::RecordWriter(RecordFile& file) : file_(file), buffers_(kTransfers * kBlockBytes) {}

void RecordWriter::write(std::span<const PointRecord> records) {
  while (!records.empty()) {
    const std::size_t slot = next_ % writing_.size();
    if (filled_ == 0 && writing_[slot].valid()) writing_[slot].get();  // its buffer is free again
    const std::size_t count = std::min(records.size(), RecordFile::kBlock - filled_);
    std::ranges::copy(
        records.first(count),
        reinterpret_cast<PointRecord*>(buffers_.data() + slot * kBlockBytes) + filled_);
    filled_ += count;
    records = records.subspan(count);
    if (filled_ == RecordFile::kBlock) flush();
  }
}

void RecordWriter::flush() {
  const std::size_t slot = next_ % writing_.size();
  const std::span<const std::byte> block(buffers_.data() + slot * kBlockBytes,
                                         direct_blocks(filled_ * sizeof(PointRecord)));
  writing_[slot] =
      in_background([this, block, at = next_ * kBlockBytes] { file_.file_->write_at(at, block); });
  file_.records_ += filled_;
  ++next_;
  filled_ = 0;
}

void RecordWriter::finish() {
  if (filled_ > 0) flush();
  for (auto& writing : writing_) {
    if (writing.valid()) writing.get();
  }
}

RecordReader::RecordReader(const RecordFile& file)
    : file_(file), buffers_(kTransfers * kBlockBytes) {
  while (ahead_ < kTransfers) read_ahead();
}

RecordReader::~RecordReader() = default;

void RecordReader::read_ahead() {
  const std::uint64_t block = ahead_++;
  if (block >= blocks_of(file_)) return;
  const std::size_t slot = block % reading_.size();
  reading_[slot] = in_background([this, block, slot] {
    file_.file_->read_at(block * kBlockBytes,
                         {buffers_.data() + slot * kBlockBytes, file_.block_bytes(block)});
  });
}

std::span<const PointRecord> RecordReader::next() {
  if (next_ > 0) read_ahead();  // into the buffer of the block that the caller has finished
  if (next_ == blocks_of(file_)) return {};
  const std::uint64_t block = next_++;
  const std::size_t slot = block % reading_.size();
  reading_[slot].get();
  const std::uint64_t left = file_.records() - block * RecordFile::kBlock;
  return {reinterpret_cast<const PointRecord*>(buffers_.data() + slot * kBlockBytes),
          static_cast<std::size_t>(std::min<std::uint64_t>(left, RecordFile::kBlock))};
}

std::vector<MortonKey> sample_of(const RecordFile& input) {
  constexpr std::uint64_t kSampleKeys = 100'000;
  std::vector<MortonKey> sample;
  RecordReader reader(input);
  const std::uint64_t stride = input.records() / kSampleKeys + 1;
  std::uint64_t at = 0, begin = 0;
  for (std::span<const PointRecord> block = reader.next(); !block.empty(); block = reader.next()) {
    for (; at < begin + block.size(); at += stride)
      sample.push_back(block[static_cast<std::size_t>(at - begin)].key);
    begin += block.size();
  }
  return sample;
}

Frame for_each_city_record(std::uint64_t points,
                           const std::function<void(std::span<const PointRecord>)>& sink) {
  const Bounds bounds = city_bounds(points);
  const Frame frame = frame_around({bounds.low.x, bounds.low.y, bounds.low.z},
                                   {bounds.high.x, bounds.high.y, bounds.high.z});
  const std::unique_ptr<PointSource> city = make_city(points);
  std::vector<Surfel> surfels(4096);
  std::vector<PointRecord> records(surfels.size());
  while (const std::size_t count = city->next(surfels)) {
    std::transform(surfels.begin(), surfels.begin() + static_cast<std::ptrdiff_t>(count),
                   records.begin(), [&](const Surfel& surfel) { return to_record(surfel, frame); });
    sink(std::span<const PointRecord>(records).first(count));
  }
  return frame;
}

}  // namespace ptc::bench
