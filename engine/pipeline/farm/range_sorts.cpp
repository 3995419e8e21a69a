#include "engine/pipeline/farm/range_sorts.h"

#include <utility>

#include "engine/base/background.h"

namespace ptc {

RangeSorts::RangeSorts(SortOptions options, Read read, const Executor& executor)
    : read_(std::move(read)), executor_(executor) {
  options.restarts = true;
  for (auto& sorter : sorters_)
    sorter = std::make_unique<ExternalSorter>(options, executor, std::span<const MortonKey>());
  begin_next();
}

std::size_t RangeSorts::next(std::span<PointRecord> out) {
  if (error_) std::rethrow_exception(error_);
  try {
    std::size_t count = stream_ ? stream_->next(out) : 0;
    while (count == 0 && take_next()) count = stream_->next(out);
    return count;
  } catch (...) {
    error_ = std::current_exception();
    throw;
  }
}

/// Goes on with the range that was read, and begins to read another. @return  whether there is one
bool RangeSorts::take_next() {
  if (!reading_.valid()) return false;
  stream_ = nullptr;
  if (!reading_.get()) return false;
  ExternalSorter& sorter = *sorters_[turn_];
  turn_ = 1 - turn_;
  begin_next();
  stream_ = sorter.finish();
  return true;
}

void RangeSorts::begin_next() {
  const auto read = [this, sorter = sorters_[turn_].get()] { return read_(*sorter); };
  reading_ =
      executor_.threads() == 1 ? std::async(std::launch::deferred, read) : in_background(read);
}

}  // namespace ptc
