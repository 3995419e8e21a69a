// A memory cap and the parts of a job that are charged to it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ptc {

/// A memory cap that is charged part by part, by name, before the memory is allocated. When too
/// little is left, the error lists the size of every part.
class MemoryBudget {
 public:
  /// Makes a budget to which nothing is charged yet.
  /// @param job  the purpose of the memory, as in "the memory cap is too small for shading"
  /// @param field  the member of the request that holds the cap, for LimitError
  MemoryBudget(std::uint64_t cap_bytes, std::string job, std::string field = "run.memory_bytes");

  /// Charges `bytes` for `part`, a noun as in "12M for open pages". The sum may exceed the cap
  /// until rest() or require() is called.
  void charge(std::string part, std::uint64_t bytes);

  /// Returns the bytes of the cap that remain for `part` after all charges.
  /// @throws LimitError when fewer than `min_bytes` remain; it names the smallest cap that works
  ///         and every part of it
  [[nodiscard]] std::uint64_t rest(const std::string& part, std::uint64_t min_bytes) const;

  /// Returns the bytes of the cap that are not charged yet; 0 when more is charged.
  [[nodiscard]] std::uint64_t left() const noexcept {
    return cap_ > charged_ ? cap_ - charged_ : 0;
  }

  /// Checks that the charges do not exceed the cap. @throws LimitError as rest() does
  void require() const { static_cast<void>(rest({}, 0)); }

 private:
  std::uint64_t cap_;          ///< bytes
  std::uint64_t charged_ = 0;  ///< sum of all parts, bytes
  std::string job_;
  std::string field_;
  std::vector<std::pair<std::string, std::uint64_t>> parts_;  ///< name and bytes of each charge
};

}  // namespace ptc
