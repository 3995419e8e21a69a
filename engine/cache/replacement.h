// Which page leaves when another needs its frame.
#pragma once

#include <cstdint>
#include <memory>

namespace ptc {

/// clock: a second chance for what was asked for since the hand last came by; a hit writes nothing
/// that others read, but for a flag that is not set yet. lru: what was asked for longest ago; a hit
/// takes a lock.
enum class Replacement { clock, lru };

/// An order of the frames that may be given up. Threads: touch() may be called at any time; all
/// else under the caller's lock.
class ReplacementOrder {
 public:
  virtual ~ReplacementOrder() = default;
  /// A frame that has just been filled takes part.
  virtual void insert(std::uint32_t frame) noexcept = 0;
  /// The page of a frame that takes part, and goes on to meanwhile, was asked for.
  virtual void touch(std::uint32_t frame) noexcept = 0;
  /// The next frame to give up; who does not erase() it gets another next time, and it after all
  /// others.
  /// @pre some frame takes part
  [[nodiscard]] virtual std::uint32_t candidate() noexcept = 0;
  /// A frame takes no part any more.
  virtual void erase(std::uint32_t frame) noexcept = 0;
};

[[nodiscard]] std::unique_ptr<ReplacementOrder> make_replacement_order(Replacement replacement,
                                                                       std::uint32_t frames);

/// Bytes that the larger of them takes for a frame.
inline constexpr std::uint64_t kReplacementBytes = 8;

}  // namespace ptc
