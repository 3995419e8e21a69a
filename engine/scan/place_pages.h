// Pages of places in memory, loaded when they are asked for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "engine/scan/neighbour_kernels.h"
#include "engine/scan/scan_spool.h"

namespace ptc {

/// Holds the positions of a fixed number of pages. When all slots are taken, the page that was
/// asked for least recently gives way.
///
/// Memory: bytes().   Threads: one; each thread has its own.
class PlacePages {
 public:
  /// @param spool  finished; must outlive this
  /// @param slots  pages that are held at the same time, at least 1; their places are below 2^32
  PlacePages(const ScanSpool& spool, std::size_t slots);
  /// Returns the memory that this takes for pages of a size, bytes.
  [[nodiscard]] static std::uint64_t bytes(std::size_t page_places, std::size_t slots) noexcept;

  [[nodiscard]] std::size_t slots() const noexcept { return page_of_.size(); }
  /// Loads the pages that are not in memory yet. They stay until the next call.
  /// @param pages  different pages, no more than slots()
  /// @param slots  is overwritten with the slot of each page
  /// @throws std::system_error, DataError when the spool cannot be read
  void load(std::span<const std::uint32_t> pages, std::vector<std::uint32_t>& slots);
  /// Returns the positions of the page in a slot.
  [[nodiscard]] PageView view(std::uint32_t slot) const noexcept;
  /// Returns the id of the first place of the page in a slot; the others follow.
  [[nodiscard]] std::uint32_t first_id(std::uint32_t slot) const noexcept {
    return slot << page_shift_;
  }
  /// Returns the number of a place from its id.
  [[nodiscard]] std::uint64_t place(std::uint32_t id) const noexcept {
    const std::uint32_t slot = id >> page_shift_;
    return (std::uint64_t{page_of_[slot]} << page_shift_) + (id - (slot << page_shift_));
  }

 private:
  [[nodiscard]] std::uint32_t free_slot() noexcept;
  void fill(std::uint32_t slot, std::uint32_t page);

  const ScanSpool& spool_;
  int page_shift_;  ///< log2 of the places in a page
  std::size_t page_places_, groups_, slot_numbers_;
  std::vector<std::uint32_t> page_of_;  ///< by slot; kNone where it is empty
  std::vector<std::uint64_t> asked_;    ///< by slot: the call of load() that asked last
  std::uint64_t call_ = 0;
  std::unordered_map<std::uint32_t, std::uint32_t> slot_of_;
  std::vector<double> numbers_;  ///< by slot: positions and boxes, see view()
  std::vector<Place> read_;      ///< room for the places of a page
};

}  // namespace ptc
