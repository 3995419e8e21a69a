// What may have damaged a piece of a file, told from its bytes alone.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "engine/verify/finding.h"
#include "format/container.h"

namespace ptc {

struct Diagnosis {
  Cause cause = Cause::unknown;
  std::string text;          ///< what was seen, to follow the fault; may be empty
  std::uint64_t offset = 0;  ///< of what was seen, in the bytes looked at
  std::uint64_t bytes = 0;
  unsigned bit = 0;  ///< of the byte there, when it is flipped
};

/// The first bytes of a file that lacks the magic: taken for text on the way, zeroed, or another
/// format.
[[nodiscard]] Diagnosis diagnose_magic(std::span<const std::byte> begin);

/// Work that may go into finding flipped bits: every bit is tried, which for a page of 64 KiB
/// hashes 34 GB.
class FlipBudget {
 public:
  explicit FlipBudget(std::uint64_t hashed_bytes)
      : left_(static_cast<std::int64_t>(hashed_bytes)) {}
  /// False when so much is not left.   Threads: any.
  [[nodiscard]] bool take(std::uint64_t hashed_bytes) noexcept {
    const auto wanted = static_cast<std::int64_t>(hashed_bytes);
    if (left_.fetch_sub(wanted) >= wanted) return true;
    left_.fetch_add(wanted);
    return false;
  }

 private:
  std::atomic<std::int64_t> left_;
};

/// A block or page header that broke a rule, and would not with one bit flipped or is zero.
/// @param decodes  throws FormatError as long as it is broken
[[nodiscard]] Diagnosis diagnose_sealed(std::span<std::byte> bytes,
                                        const std::function<void()>& decodes, FlipBudget& budget);

/// A stored payload whose checksum is not `expected`.
/// @param zeros_tell  whether zeroed sectors are no part of a sound payload: it is compressed
/// @param offset      of the payload in the file: sectors are counted from its start
[[nodiscard]] Diagnosis diagnose_payload(std::span<std::byte> stored, std::uint64_t expected,
                                         bool zeros_tell, std::uint64_t offset, FlipBudget& budget);

/// Adds what was seen to a finding.
/// @param offset  of the bytes looked at, in the file
void apply(const Diagnosis& diagnosis, std::uint64_t offset, Finding& finding);

}  // namespace ptc
