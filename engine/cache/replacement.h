// Replacement policies: which page is evicted when another needs its frame.
#pragma once

#include <cstdint>
#include <memory>

namespace ptc {

/// A replacement policy.
enum class Replacement {
  clock,  ///< second chance: pages used since the hand last passed are spared once. A hit writes no
          ///< shared memory, except for a flag that is not set yet
  lru     ///< the least recently used page is evicted. A hit takes a lock
};

/// Orders the frames whose pages may be evicted.
/// Threads: touch() may be called at any time; all other functions need the caller's lock.
class ReplacementOrder {
 public:
  virtual ~ReplacementOrder() = default;
  /// Adds a frame to the order, after its page was read.
  virtual void insert(std::uint32_t frame) noexcept = 0;
  /// Notes that the page of a frame was used. @pre the frame is in the order, and stays in it
  /// during the call
  virtual void touch(std::uint32_t frame) noexcept = 0;
  /// Returns the next candidate for eviction. If the caller does not erase() it, it moves to the
  /// back of the order. @pre the order is not empty
  [[nodiscard]] virtual std::uint32_t candidate() noexcept = 0;
  /// Removes a frame from the order.
  virtual void erase(std::uint32_t frame) noexcept = 0;
};

/// Returns an empty order.
/// @param frames  number of frames; insert() takes numbers below it
[[nodiscard]] std::unique_ptr<ReplacementOrder> make_replacement_order(Replacement replacement,
                                                                       std::uint32_t frames);

/// Memory that the larger of the two orders takes for each frame, bytes.
inline constexpr std::uint64_t kReplacementBytes = 8;

}  // namespace ptc
