// Pages that cannot be read, for a gather that goes on without them (spec/shading.md#damage).
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/cache/page_cache.h"
#include "engine/store/point_scan.h"

namespace ptc {

/// Which pages break a rule of the format, as far as anyone has asked. Each is looked at once: one
/// that becomes damaged later is an error for who reads it. What the system cannot read is an error
/// at once. Threads: may be shared.   Memory: a byte a page of the container.
class LostPages {
 public:
  explicit LostPages(const ContainerReader& container) : states_(container.page_count()) {}

  /// @param reader  of the same container; the page it gave before is gone
  /// @throws std::system_error, std::invalid_argument when there is no such page
  [[nodiscard]] bool contains(std::uint32_t page, PageReader& reader);
  /// Marks a page that broke a rule when it was read in another way.
  void add(std::uint32_t page, const char* why);
  /// What is wrong with each, by page.
  [[nodiscard]] std::map<std::uint32_t, std::string> list() const;

 private:
  enum State : std::uint8_t { kUnknown, kWhole, kLost };
  std::vector<std::atomic<std::uint8_t>> states_;  ///< by page
  mutable std::mutex mutex_;
  std::map<std::uint32_t, std::string> why_;  ///< guarded by mutex_
};

/// Notes damaged pages of a scan in `lost`.
/// @param lost  null: damaged pages are errors
[[nodiscard]] PointScan::OnDamage noted_in(LostPages* lost);

}  // namespace ptc
