// Growth of a frame, and a merge of two streams block by block.
#include "engine/octree/merge.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/base/error.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 1 << 14;  // points read from each stream at once

/// Returns the origin in lattice units, which is a whole number that a double holds exactly.
double origin_units(const Frame& frame, std::size_t axis) {
  return frame.origin[axis] / frame.unit();
}

/// Returns whether points from `low` to `high` along an axis round to lattice points of a frame.
bool holds(const Frame& frame, std::size_t axis, double low, double high) {
  const double half = 0.5 * frame.unit();
  return low >= frame.origin[axis] - half &&
         high <= frame.origin[axis] + (frame.edge - frame.unit()) + half;
}

/// Moves the keys of a stream.
class MovedStream : public PointStream {
 public:
  MovedStream(PointStream& sorted, const LatticeMove& move) : sorted_(sorted), move_(move) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = sorted_.next(out);
    for (PointRecord& point : out.first(count)) point.key = move_(point.key);
    return count;
  }

 private:
  PointStream& sorted_;
  LatticeMove move_;
};

/// Merges two sorted streams.
class MergedStream : public PointStream {
 public:
  MergedStream(PointStream& first, PointStream& second) : first_{first}, second_{second} {}

  std::size_t next(std::span<PointRecord> out) override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const bool more_first = first_.fill(), more_second = second_.fill();
      if (!more_first && !more_second) return i;
      const bool from_second =
          more_second && (!more_first || second_.front().key < first_.front().key);
      out[i] = (from_second ? second_ : first_).take();
    }
    return out.size();
  }

 private:
  /// One of the two streams, with a block that was read from it.
  struct Side {
    PointStream& stream;
    std::vector<PointRecord> block = std::vector<PointRecord>(kBlock);
    std::size_t at = 0, end = 0;
    bool ended = false;

    /// Reads the next block when the current one is used up. Returns false at the end of the
    /// stream.
    bool fill() {
      if (at < end) return true;
      if (ended) return false;
      end = stream.next(block);
      at = 0;
      ended = end == 0;
      return !ended;
    }
    [[nodiscard]] const PointRecord& front() const noexcept { return block[at]; }
    const PointRecord& take() noexcept { return block[at++]; }
  };

  Side first_, second_;
};

}  // namespace

Frame grow_frame(const Frame& old, const std::array<double, 3>& low,
                 const std::array<double, 3>& high) {
  static_cast<void>(frame_around(low, high));  // refuses bounds that no frame can hold
  Frame grown = old;
  std::array<double, 3> offset{};
  for (int doublings = 1;; ++doublings) {
    std::array<bool, 3> fits{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      fits[axis] = holds(grown, axis, low[axis], high[axis]);
    if (std::ranges::all_of(fits, [](bool fit) { return fit; })) return grown;
    if (doublings > kMaxDoublings) {
      throw RequestError(
          "append",
          "the new points lie so far from the scene that its cube would have to grow "
          "more than 65536 times: build the whole scene again, without `append`");
    }
    // Double the cube towards the side on which the box lies outside.
    const Frame before = grown;
    grown.edge = 2 * before.edge;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool below = low[axis] < before.origin[axis] - 0.5 * before.unit();
      offset[axis] = offset[axis] / 2 + (below ? std::ldexp(1.0, kLatticeBits - 1) : 0);
      // The old origin may lie between two units of the grown lattice. Round it up, because halving
      // rounds the coordinates down.
      grown.origin[axis] =
          (std::ceil(std::ldexp(origin_units(old, axis), -doublings)) - offset[axis]) *
          grown.unit();
    }
  }
}

LatticeMove::LatticeMove(const Frame& old, const Frame& grown) noexcept
    : doublings_(std::ilogb(grown.edge) - std::ilogb(old.edge)) {
  for (std::size_t axis = 0; axis < 3 && moves(); ++axis) {
    const double origin = std::ceil(std::ldexp(origin_units(old, axis), -doublings_));
    offset_[axis] = static_cast<std::uint64_t>(origin - origin_units(grown, axis));
  }
}

MortonKey LatticeMove::operator()(const MortonKey& key) const noexcept {
  LatticePoint point = decode_morton(key);
  for (std::size_t axis = 0; axis < 3; ++axis)
    point[axis] = (point[axis] >> doublings_) + offset_[axis];
  return encode_morton(point);
}

std::unique_ptr<PointStream> move_points(PointStream& sorted, const LatticeMove& move) {
  return std::make_unique<MovedStream>(sorted, move);
}

std::unique_ptr<PointStream> merge_points(PointStream& first, PointStream& second) {
  return std::make_unique<MergedStream>(first, second);
}

}  // namespace ptc
