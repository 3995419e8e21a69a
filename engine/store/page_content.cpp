// Decoding and what is checked after it (engine/store/page_content.h).
#include "engine/store/page_content.h"

#include <bit>
#include <limits>
#include <string>

#include "engine/store/clauses.h"
#include "format/checksum.h"
#include "format/node_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kAgreement[] = "spec/container.md#page-agreement";
constexpr char kPayload[] = "spec/container.md#page-payload";
constexpr char kReferences[] = "spec/nodes.md#references";

/// Every interior child is a group that exists: who follows a reference has only to check that
/// levels increase.
void verify_references(const NodePage& nodes, const PageRules& rules) {
  for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
    const GroupView group = nodes[slot];
    for (unsigned rest = group.interior_mask(); rest != 0; rest &= rest - 1) {
      const ChildRef child = group.child(std::countr_zero(rest));
      if (child.slot < rules.node_pages[child.page].record_count) continue;
      throw FormatError(0, child.page < rules.own_pages ? kReferences : clause::kPartsTop,
                        "group " + std::to_string(slot) + " refers to group " +
                            std::to_string(child.slot) + " of node page " +
                            std::to_string(child.page) + ", which there is not");
    }
  }
}

void verify_content(const PageHeader& page, std::span<const std::byte> payload,
                    const PageRules& rules) {
  if (page.type == PageType::point)
    PointPage(payload, page.record_count, rules.point_bytes).verify();
  if (page.type != PageType::node) return;
  const bool may_emit = rules.point_bytes != kPointBytes;
  if (rules.node_pages.empty()) {
    constexpr auto kAny = std::numeric_limits<std::uint64_t>::max();
    static_cast<void>(NodePage(payload, page.record_count, kNoPage, kAny, may_emit));
    return;
  }
  const auto pages = static_cast<std::uint32_t>(rules.node_pages.size());
  verify_references(NodePage(payload, page.record_count, pages, rules.points, may_emit), rules);
}

PayloadColumns columns_of(const PageHeader& page, const PageRules& rules) {
  if (page.type == PageType::point)
    return {page.record_count, packed_point_columns(rules.point_bytes)};
  if (rules.columns == nullptr) return {page.record_count, {}};
  const auto found = rules.columns->find(page.group);
  if (found == rules.columns->end()) return {page.record_count, {}};
  return {page.record_count, found->second};
}

}  // namespace

GroupColumns columns_by_group(const Meta& meta) {
  GroupColumns columns;
  for (const Channel& channel : meta.channels) {
    columns.try_emplace(channel.group, packed_group_columns(meta.channels, channel.group));
  }
  return columns;
}

PageHeader decode_agreed_header(std::span<const std::byte> image, const FileHeader& file,
                                const DirectoryEntry& entry, std::optional<std::uint32_t> rank) {
  const PageHeader found = decode_page_header(image.first(kPageHeaderBytes), file);
  if (found.rank != rank.value_or(found.rank) || entry_of(found, entry.offset) != entry)
    throw FormatError(0, kAgreement, "the page header is not what the directory says");
  return found;
}

void check_payload(std::span<const std::byte> image, const PageHeader& page) {
  if (xxh3_64(image.subspan(kPageHeaderBytes)) != page.payload_xxh3)
    throw FormatError(kPageHeaderBytes, kPayload, "payload's checksum is wrong");
}

void decode_payload(const PageHeader& page, std::span<const std::byte> stored,
                    const PageRules& rules, std::span<std::byte> out, PageDecoder& decoder) {
  const std::span<std::byte> payload = out.first(page.raw_bytes);
  try {
    decoder.decode(page.coding, stored, payload, columns_of(page, rules));
  } catch (const FormatError& error) {
    throw error.rebased(kPageHeaderBytes, "");
  }
  try {
    verify_content(page, payload, rules);
  } catch (const FormatError& error) {
    throw placed_in_page(error, page);
  }
}

FormatError placed_in_page(const FormatError& error, const PageHeader& page) {
  if (page.coding.codec == Codec::raw) {
    return {kPageHeaderBytes + error.offset(), error.clause(), error.text()};
  }
  return {kPageHeaderBytes, error.clause(),
          "decoded byte " + std::to_string(error.offset()) + ": " + error.text()};
}

}  // namespace ptc
