// The damaged pages of a container, for a gather that goes on without them
// (spec/shading.md#damage).
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

/// The set of pages that break a rule of the format, as far as they were asked for.
///
/// Each page is read once to find out. A page that becomes damaged after that is an error for its
/// reader. A page that the system cannot read is an error at once.
/// Threads: all members may be called concurrently.   Memory: one byte for each page of the
/// container.
class LostPages {
 public:
  /// Begins with all pages unknown.
  explicit LostPages(const ContainerReader& container) : states_(container.page_count()) {}

  /// Reports whether a page is damaged; reads the page the first time.
  /// @param reader  reader of the same container that has no page pinned
  /// @throws std::system_error; std::invalid_argument when the container has no such page;
  ///         std::logic_error when the reader has a page pinned
  [[nodiscard]] bool contains(std::uint32_t page, PageReader& reader);
  /// Marks a page that broke a rule when it was read in another way.
  /// @param why  the rule that it broke; the first reason for a page is kept
  void add(std::uint32_t page, const char* why);
  /// Returns what is wrong with each damaged page, by page number.
  [[nodiscard]] std::map<std::uint32_t, std::string> list() const;

 private:
  /// What is known of a page: nothing yet, that it keeps the rules, or that it breaks one.
  enum State : std::uint8_t { kUnknown, kWhole, kLost };
  std::vector<std::atomic<std::uint8_t>> states_;  ///< State of each page
  mutable std::mutex mutex_;
  std::map<std::uint32_t, std::string> why_;  ///< reason for each lost page; guarded by mutex_
};

/// Returns a handler for PointScan that notes the damaged pages of the scan in `lost`.
/// @param lost  must outlive the scan; null gives no handler, so that damaged pages are errors
[[nodiscard]] PointScan::OnDamage noted_in(LostPages* lost);

}  // namespace ptc
