// Loops over streams of points.
#include "engine/sort/point_streams.h"

#include <algorithm>
#include <future>
#include <utility>
#include <vector>

#include "engine/base/background.h"

namespace ptc {
namespace {

constexpr std::size_t kAhead = std::size_t{1} << 14;  // records of a block

class AheadStream final : public PointStream {
 public:
  explicit AheadStream(PointStream& points) : points_(points) { read_next(); }

  std::size_t next(std::span<PointRecord> out) override {
    if (left_.empty()) {
      if (!reading_.valid()) return 0;
      const std::size_t count = reading_.get();
      std::swap(block_, ahead_);
      left_ = std::span(block_).first(count);
      if (count > 0) read_next();
    }
    const std::size_t count = std::min(out.size(), left_.size());
    std::ranges::copy(left_.first(count), out.begin());
    left_ = left_.subspan(count);
    return count;
  }

 private:
  void read_next() {
    reading_ = in_background([this] { return points_.next(ahead_); });
  }

  PointStream& points_;
  std::vector<PointRecord> block_ = std::vector<PointRecord>(kAhead),
                           ahead_ = std::vector<PointRecord>(kAhead);
  std::span<const PointRecord> left_;  ///< of the block
  std::future<std::size_t> reading_;   ///< last member: its destructor waits for the thread
};

}  // namespace

std::size_t read_full(PointStream& points, std::span<PointRecord> block) {
  std::size_t filled = 0;
  while (filled < block.size()) {
    const std::size_t count = points.next(block.subspan(filled));
    if (count == 0) break;
    filled += count;
  }
  return filled;
}

void pass_over(PointStream& points, std::uint64_t count) {
  constexpr std::uint64_t kPassed = 1 << 14;  // records that are passed over at once
  std::vector<PointRecord> passed(
      static_cast<std::size_t>(std::min<std::uint64_t>(count, kPassed)));
  while (count > 0) {
    const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(count, passed.size()));
    const std::size_t now = points.next(std::span(passed).first(most));
    if (now == 0) return;
    count -= now;
  }
}

std::unique_ptr<PointStream> read_ahead(PointStream& points) {
  return std::make_unique<AheadStream>(points);
}

}  // namespace ptc
