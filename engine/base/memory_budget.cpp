// Charges against a memory cap, and the error that lists them when the cap is too small.
#include "engine/base/memory_budget.h"

#include <algorithm>

#include "engine/base/error.h"

namespace ptc {
namespace {

// Rounds up, so that the cap that an error names is large enough.
std::string mebibytes(std::uint64_t bytes) {
  constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20;
  return std::to_string(bytes / kMebibyte + (bytes % kMebibyte != 0 ? 1 : 0)) + "M";
}

}  // namespace

MemoryBudget::MemoryBudget(std::uint64_t cap_bytes, std::string job, std::string field)
    : cap_(cap_bytes), job_(std::move(job)), field_(std::move(field)) {}

void MemoryBudget::charge(std::string part, std::uint64_t bytes) {
  charged_ += bytes;
  if (bytes > 0) parts_.emplace_back(std::move(part), bytes);
}

std::uint64_t MemoryBudget::rest(const std::string& part, std::uint64_t min_bytes) const {
  if (cap_ >= charged_ && cap_ - charged_ >= min_bytes) return cap_ - charged_;

  // List the parts, the largest first.
  auto parts = parts_;
  if (min_bytes > 0) parts.emplace_back(part, min_bytes);
  std::ranges::stable_sort(parts, std::greater{}, &decltype(parts)::value_type::second);
  std::string list;
  for (const auto& [name, bytes] : parts) {
    list += (list.empty() ? "" : ", ") + mebibytes(bytes) + " for " + name;
  }
  throw LimitError("the memory cap is too small for " + job_ + ": the least that works is " +
                       mebibytes(charged_ + min_bytes) + " (" + list + ")",
                   field_);
}

}  // namespace ptc
