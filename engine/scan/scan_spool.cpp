#include "engine/scan/scan_spool.h"

#include <bit>

namespace ptc {
namespace {

constexpr std::size_t kPending = std::size_t{1} << 13;  // places that are written at once

}  // namespace

ScanSpool::ScanSpool(const std::vector<std::filesystem::path>& directories,
                     std::uint64_t index_bytes)
    : record_file_(directories.front()), place_file_(directories.back()), index_(index_bytes) {
  pending_.reserve(kPending);
}

void ScanSpool::add_records(std::span<const PointRecord> records) {
  record_file_.write_at(records_ * sizeof(PointRecord), std::as_bytes(records));
  records_ += records.size();
}

void ScanSpool::add_places(std::span<const PointRecord> records) {
  for (const PointRecord& record : records) {
    if (index_.places() > 0 && record.key == last_) continue;
    last_ = record.key;
    index_.add(position_of(last_));
    pending_.push_back({last_, std::bit_cast<std::uint32_t>(record.normal), record.flags & 1U});
    if (pending_.size() == kPending) write_places();
  }
}

void ScanSpool::finish() {
  write_places();
  pending_ = {};
  index_.finish();
}

void ScanSpool::write_places() {
  place_file_.write_at(places_written_ * sizeof(Place), std::as_bytes(std::span(pending_)));
  places_written_ += pending_.size();
  pending_.clear();
}

void ScanSpool::read_records(std::uint64_t first, std::span<PointRecord> out) const {
  record_file_.read_at(first * sizeof(PointRecord), std::as_writable_bytes(out));
}

void ScanSpool::read_places(std::uint64_t first, std::span<Place> out) const {
  place_file_.read_at(first * sizeof(Place), std::as_writable_bytes(out));
}

void ScanSpool::discard_places() noexcept {
  place_file_.discard(0, places() * sizeof(Place));
}

}  // namespace ptc
