// A memory cap and what is charged to it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace ptc {

/// A memory cap that is charged part by part, by name, before the memory is taken. When too little
/// is left, the refusal tells what takes how much.
class MemoryBudget {
 public:
  /// @param job  what the memory is for, as in "the memory cap is too small for shading"
  MemoryBudget(std::uint64_t cap_bytes, std::string job);

  /// Sets `bytes` apart for `part`, a noun as in "12M for open pages". The cap may be exceeded
  /// until rest() is called.
  void charge(std::string part, std::uint64_t bytes);

  /// Bytes that are left for `part` when all that was charged is taken.
  /// @throws LimitError when they are fewer than `min_bytes`; it names the least cap that works
  ///         and every part of it
  [[nodiscard]] std::uint64_t rest(const std::string& part, std::uint64_t min_bytes) const;

  /// Checks that the cap holds what was charged. @throws LimitError as rest()
  void require() const { static_cast<void>(rest({}, 0)); }

 private:
  std::uint64_t cap_;
  std::uint64_t charged_ = 0;
  std::string job_;
  std::vector<std::pair<std::string, std::uint64_t>> parts_;
};

}  // namespace ptc
