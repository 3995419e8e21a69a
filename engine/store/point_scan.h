// Reads the point pages of a container one after another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/store/reader.h"
#include "format/error.h"
#include "format/point_page.h"

namespace ptc {

/// A pass over point pages. Memory: one page.
///
///     PointScan scan(container);
///     while (scan.next()) use(scan.points());
class PointScan {
 public:
  /// Receives the number of a damaged page and what is wrong with it.
  using OnDamage = std::function<void(std::uint32_t page, const FormatError& error)>;

  /// Begins a scan over all point pages, in order.
  /// @param container  must outlive the scan
  /// @param on_damage  when given, a damaged page is no error: it is reported here, and whole() is
  ///                   false
  explicit PointScan(const ContainerReader& container, OnDamage on_damage = {})
      : PointScan(container, container.point_pages(), std::move(on_damage)) {}
  /// Begins a scan over some point pages.
  /// @param pages  numbers of point pages
  PointScan(const ContainerReader& container, PageNumbers::Range pages, OnDamage on_damage = {});

  /// Reads the next page.
  /// @return false at the end
  /// @throws FormatError for a damaged page when there is no `on_damage`; std::system_error
  bool next();
  /// Passes over pages without reading them, at most to the end.
  void skip(std::size_t pages) noexcept;
  /// Passes over the pages that lie within the next points, without reading them.
  /// @return  how many of the points lie on the page that next() would read, fewer than it has, or
  ///          behind the last page
  [[nodiscard]] std::uint64_t skip_points(std::uint64_t points) noexcept;

  /// Number of points on the page that next() would read; 0 at the end.
  [[nodiscard]] std::uint32_t next_count() const noexcept;

  /// Index of the page that next() read, among those of the scan.
  [[nodiscard]] std::size_t index() const noexcept { return next_ - 1; }
  /// Number of points on that page.
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  /// False when that page is damaged, so that it has no points().
  [[nodiscard]] bool whole() const noexcept { return whole_; }
  /// The points of that page, valid until the next call of next().
  [[nodiscard]] PointPage points() const {
    return {payload_.data(), count_, container_.header().point_bytes};
  }

 private:
  const ContainerReader& container_;
  PageNumbers::Range pages_;
  OnDamage on_damage_;
  std::vector<std::byte> payload_;
  PageDecoder decoder_;
  std::size_t next_ = 0;
  std::uint32_t count_ = 0;
  bool whole_ = true;
};

}  // namespace ptc
