// The points of a container as they went into it.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/sort/external_sort.h"
#include "engine/store/reader.h"

namespace ptc {

/// All points of a container by ascending key, read page by page.   Memory: two pages.
class ContainerPoints : public PointStream {
 public:
  /// @param container  must outlive this
  explicit ContainerPoints(const ContainerReader& container);
  /// @throws FormatError, also when the keys of one page to the next descend; std::system_error
  std::size_t next(std::span<PointRecord> out) override;

 private:
  [[noreturn]] void refuse(std::uint32_t page) const;

  const ContainerReader& container_;
  PageDecoder decoder_;
  std::vector<std::byte> payload_;
  std::size_t next_page_ = 0;  ///< into point_pages()
  std::uint32_t count_ = 0;    ///< points of the page in payload_
  std::uint32_t at_ = 0;       ///< next of them
  MortonKey last_;             ///< of the points handed out
};

}  // namespace ptc
