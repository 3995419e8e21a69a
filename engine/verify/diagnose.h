// The likely cause of damage, diagnosed from the damaged bytes alone (spec/recovery.md#causes).
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

/// What a stretch of damaged bytes suggests about the cause of its damage.
struct Diagnosis {
  Cause cause = Cause::unknown;
  std::string text;          ///< the evidence, in words that may follow a colon; may be empty
  std::uint64_t offset = 0;  ///< of the damaged part, from the first byte that was examined
  std::uint64_t bytes = 0;   ///< length of the damaged part; 0 when it is not known
  unsigned bit = 0;          ///< the flipped bit of that byte, 0 the lowest, for Cause::bit_flip
};

/// Diagnoses the first bytes of a file that lacks the magic: a transfer treated them as text, they
/// were zeroed, the file ends too early, or it has another format.
/// @param begin  the first 16 bytes of the file, or all of a shorter file
[[nodiscard]] Diagnosis diagnose_magic(std::span<const std::byte> begin);

/// Limits the work that goes into finding flipped bits. The search tries every bit and hashes all
/// bytes for each of them, which for a page of 64 KiB is 34 GB.
class FlipBudget {
 public:
  /// @param hashed_bytes  bytes that all searches together may hash
  explicit FlipBudget(std::uint64_t hashed_bytes)
      : left_(static_cast<std::int64_t>(hashed_bytes)) {}
  /// Takes the cost of one search from the budget. Returns false, and takes nothing, when less than
  /// that is left.   Threads: may be called concurrently.
  [[nodiscard]] bool take(std::uint64_t hashed_bytes) noexcept {
    const auto wanted = static_cast<std::int64_t>(hashed_bytes);
    if (left_.fetch_sub(wanted) >= wanted) return true;
    left_.fetch_add(wanted);
    return false;
  }

 private:
  std::atomic<std::int64_t> left_;
};

/// Diagnoses a block or page header that breaks a rule: all of it is zero, or flipping one bit
/// makes it valid.
/// @param bytes    the header, which is unchanged when the function returns
/// @param decodes  decodes `bytes` as they stand, and throws FormatError while they are invalid
[[nodiscard]] Diagnosis diagnose_sealed(std::span<std::byte> bytes,
                                        const std::function<void()>& decodes, FlipBudget& budget);

/// Diagnoses a stored payload whose checksum is not `expected`: sectors of it are zero, or flipping
/// one bit makes the checksum right.
/// @param stored      the payload, which is unchanged when the function returns
/// @param zeros_tell  whether a single zeroed sector proves damage, which holds for compressed
///                    payloads; a raw payload may contain zeros and is called zeroed only as a
///                    whole
/// @param offset      of the payload in the file, whose start sectors are aligned to
[[nodiscard]] Diagnosis diagnose_payload(std::span<std::byte> stored, std::uint64_t expected,
                                         bool zeros_tell, std::uint64_t offset, FlipBudget& budget);

/// Adds a diagnosis to a finding: the cause, the evidence, and the damaged part when it is known.
/// @param offset  file offset of the first byte that was examined
void apply(const Diagnosis& diagnosis, std::uint64_t offset, Finding& finding);

}  // namespace ptc
