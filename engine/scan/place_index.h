// A sparse spatial index of places on the Z-curve: a box for every page of consecutive places, and
// boxes around boxes above them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

namespace ptc {

/// A position in lattice units, whose coordinates are exact.
using LatticePosition = std::array<double, 3>;

/// An axis-aligned box of lattice positions, which is empty while low > high.
struct LatticeBox {
  LatticePosition low{0x1p60, 0x1p60, 0x1p60};
  LatticePosition high{-0x1p60, -0x1p60, -0x1p60};

  /// Enlarges the box to hold a position.
  void add(const LatticePosition& p) noexcept;
  /// Enlarges the box to hold another one.
  void add(const LatticeBox& other) noexcept;
  /// Returns the box that reaches `margin` farther in every direction.
  [[nodiscard]] LatticeBox grown(double margin) const noexcept;
  /// Returns the middle of the box.
  [[nodiscard]] LatticePosition centre() const noexcept;
  /// Says whether two boxes share a position.
  [[nodiscard]] bool overlaps(const LatticeBox& other) const noexcept;
  /// Says whether the other box lies in this one.
  [[nodiscard]] bool contains(const LatticeBox& other) const noexcept;
  /// Returns the squared distance from a position to the box, 0 inside.
  [[nodiscard]] double squared_distance(const LatticePosition& p) const noexcept;
};

/// Finds the pages of a file of places that lie near a box or a position.
///
/// Places are numbered in the order of the Z-curve. A page holds page_places() consecutive ones:
///
///     level 2   [            box            ]
///     level 1   [    box    ] [    box    ]       each box around 8 of the level below
///     level 0   [b] [b] [b] [b] [b] [b] [b]       one box for each page
///     places    .................................
///
/// Memory: at most `max_bytes` of the constructor for any number of places, because pages double
///         when there would be too many.   Threads: const calls may be made concurrently.
class PlaceIndex {
 public:
  /// The places of the smallest pages.
  static constexpr std::size_t kSmallestPage = 256;

  /// @param max_bytes  of the index; at least 64 KiB
  explicit PlaceIndex(std::uint64_t max_bytes);

  /// Adds the next place.
  void add(const LatticePosition& position);
  /// Builds the levels above the pages, after the last place.
  void finish();

  [[nodiscard]] std::uint64_t places() const noexcept { return places_; }
  /// The number of places in a page; the last one may hold fewer.
  [[nodiscard]] std::size_t page_places() const noexcept { return page_places_; }
  [[nodiscard]] std::size_t pages() const noexcept { return levels_.front().size(); }
  /// The box around all places.
  [[nodiscard]] const LatticeBox& bounds() const noexcept { return bounds_; }

  /// Replaces `pages` by the pages whose boxes overlap a box, in ascending order.
  /// @pre finish() was called
  void overlapping(const LatticeBox& box, std::vector<std::uint32_t>& pages) const;

 private:
  friend class NearestPages;

  void halve();

  std::size_t max_pages_;
  std::size_t page_places_ = kSmallestPage;
  std::uint64_t places_ = 0;
  LatticeBox bounds_;
  std::vector<std::vector<LatticeBox>> levels_{1};
};

/// Goes through the pages of an index by increasing distance from a position.
class NearestPages {
 public:
  /// @param index  must outlive this; finished
  NearestPages(const PlaceIndex& index, const LatticePosition& position);

  /// A page, and a lower bound of the squared distance of its places.
  struct Page {
    std::uint32_t page;
    double squared;
  };
  /// Returns the next page; none when all were returned.
  [[nodiscard]] std::optional<Page> next();

 private:
  struct Entry {
    double squared;
    std::size_t level, box;
    bool operator<(const Entry& other) const noexcept { return squared > other.squared; }
  };
  void push(std::size_t level, std::size_t box);

  const PlaceIndex& index_;
  LatticePosition position_;
  std::priority_queue<Entry> entries_;
};

}  // namespace ptc
