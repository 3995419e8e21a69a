// What a page's header repeats of its records.
#include "engine/verify/checked_pages.h"

#include <algorithm>

#include <fmt/format.h>

#include "format/error.h"
#include "format/node_page.h"
#include "format/parts_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kPageKeys[] = "spec/container.md#page-keys";
constexpr char kPageLevel[] = "spec/container.md#page-level";

/// Compares the key range of a page header with that of its records, `whose` they are.
void check_keys(const PageHeader& header, std::uint64_t first, std::uint64_t last,
                const char* whose) {
  if (header.first_key == first && header.last_key == last) return;
  throw FormatError(32, kPageKeys, fmt::format("the key range is not that of its {}", whose));
}

/// Compares the level and the key range of a page header with those of its groups.
void check_groups(const PageHeader& header, const NodePage& nodes) {
  int least = kMaxLevel;
  std::uint64_t first = ~std::uint64_t{0}, last = 0;
  for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
    least = std::min(least, nodes[slot].level());
    first = std::min(first, nodes[slot].cell().high);
    last = std::max(last, nodes[slot].cell().high);
  }
  if (least != header.level)
    throw FormatError(24, kPageLevel, "the level is not the lowest level of its groups");
  check_keys(header, first, last, "groups");
}

}  // namespace

void check_page_keys(const PageHeader& header, std::span<const std::byte> payload,
                     std::uint8_t point_bytes) {
  if (header.type == PageType::point) {
    const PointPage points(payload.data(), header.record_count, point_bytes);
    check_keys(header, points[0].key.high, points[points.size() - 1].key.high, "points");
  }
  if (header.type == PageType::parts) {
    const PartRecord first = decode_part(payload.first(kPartBytes));
    const PartRecord last = decode_part(payload.last(kPartBytes));
    check_keys(header, first.first_key.high, last.last_key.high, "parts");
  }
  if (header.type == PageType::node)
    check_groups(header, NodePage(payload.data(), header.record_count));
}

}  // namespace ptc
