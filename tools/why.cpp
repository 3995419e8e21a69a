#include "tools/why.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "engine/pipeline/convert/simplification.h"
#include "engine/pipeline/scene_record.h"
#include "format/codec.h"
#include "format/packed_columns.h"

namespace ptc {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kPages = 64;  // that are measured, at most

/// What the packed columns of a point page hold, in their order.
constexpr std::array<const char*, 16> kHolds{
    "position", "position", "position", "radius", "normal", "normal",   "radiance", "radiance",
    "radiance", "albedo",   "albedo",   "albedo", "flags",  "emission", "emission", "emission"};

/// Columns of a kind, over the pages that were measured.
struct Kind {
  std::uint64_t bytes = 0;  ///< as they are coded alone
  bool constant = true;     ///< whether all values of each page are the same
};

/// Codes the columns of a page one by one as the page is coded, and adds them to their kinds.
/// @param payload  of the page
void measure(const PageHeader& page, std::span<const std::byte> payload,
             std::span<const PackedColumn> columns, std::span<Kind> kinds) {
  PageEncoder encoder(page.coding.codec);
  std::vector<std::byte> packed, coded;
  pack_columns(payload, page.record_count, columns, packed);
  std::span<const std::byte> rest(packed);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    constexpr std::size_t kHead = 10;  // shift, planes, base
    const auto planes = static_cast<std::size_t>(rest[1]);
    const std::span<const std::byte> column = rest.first(kHead + planes * page.record_count);
    rest = rest.subspan(column.size());
    kinds[i].constant = kinds[i].constant && planes == 0;
    if (page.coding.filter == Filter::columns) {
      encoder.encode(column, coded);
      kinds[i].bytes += coded.size();
    } else {
      kinds[i].bytes += std::uint64_t{columns[i].bits} * page.record_count / 8;
    }
  }
}

ordered_json parsed(const std::string& text) {
  ordered_json value = ordered_json::parse(text, nullptr, false);
  return value.is_object() ? value : ordered_json::object();
}

/// The number of a record, or 0.
double number(const ordered_json& record, const char* key) {
  const auto found = record.find(key);
  return found != record.end() && found->is_number() ? found->get<double>() : 0.0;
}

}  // namespace

ordered_json why_facts(const ContainerReader& container) {
  // Measure some pages
  const auto columns = packed_point_columns(container.header().point_bytes);
  std::array<Kind, kHolds.size()> kinds;
  const PageNumbers::Range pages = container.point_pages();
  PageDecoder decoder;
  std::vector<std::byte> payload(container.page_payload_limit());
  std::uint64_t points = 0;
  for (std::size_t rank = 0; rank < pages.size(); rank += pages.size() / kPages + 1) {
    const PageHeader page = container.read_page(pages[rank], payload, decoder);
    measure(page, std::span<const std::byte>(payload).first(page.raw_bytes), columns, kinds);
    points += page.record_count;
  }
  // Add up columns of a kind
  ordered_json bytes = ordered_json::object();
  ordered_json same = ordered_json::array();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string name = kHolds[i];
    const double each =
        points > 0 ? static_cast<double>(kinds[i].bytes) / static_cast<double>(points) : 0.0;
    bytes[name] = bytes.value(name, 0.0) + each;
  }
  for (const auto& [name, size] : bytes.items()) {
    bool constant = points > 0;
    for (std::size_t i = 0; i < columns.size(); ++i)
      constant = constant && (name != kHolds[i] || kinds[i].constant);
    if (constant) same.push_back(name);
  }
  const Superblock& all = container.superblock();
  const auto& text = container.meta().text;
  ordered_json facts{
      {"bytes_per_point", bytes},
      {"constant", same},
      {"emits", may_emit(container)},
      {"leaf_points", all.leaf_points},
      {"nodes_per_point",
       all.points > 0 ? static_cast<double>(all.nodes) / static_cast<double>(all.points) : 0.0}};
  if (const auto found = text.find(kRoundingKey); found != text.end())
    facts["rounding"] = found->second;
  if (const auto found = text.find(kSimplifiedKey); found != text.end())
    facts["simplified"] = parsed(found->second);
  return facts;
}

std::string why_text(const ordered_json& why) {
  std::string text;
  const auto simplified = why.find("simplified");
  if (simplified == why.end()) {
    text += "  why       no tolerance was asked for, so no points are merged\n";
  } else {
    const auto percent = [&](const char* key) { return 100 * number(*simplified, key); };
    text += fmt::format(
        "  why       a tolerance of {:.3g} % was asked for: what arrives at points is {:.2f} % "
        "[{:.2f}, {:.2f}] off, what leaves them {:.2f} %, albedo {:.2f} %{}\n",
        percent("tolerance"), percent("error"), percent("low"), percent("high"), percent("light"),
        percent("albedo"), simplified->contains("before") ? "; on top of an earlier one" : "");
    const double points = number(*simplified, "points"), merged = number(*simplified, "merged"),
                 made = number(*simplified, "made");
    text += points > 0 ? fmt::format(
                             "  merged    {:.0f} of {:.0f} points lie in cells that are "
                             "flat and evenly lit, and {:.0f} surfels stand for them\n",
                             merged, points, made)
                       : "  merged    no points\n";
  }
  for (const auto& [name, bytes] : why["bytes_per_point"].items()) {
    const ordered_json& constant = why["constant"];
    const bool same = std::find(constant.begin(), constant.end(), name) != constant.end();
    text += fmt::format("  {:<9} {:.2f} bytes a point{}\n", name, bytes.get<double>(),
                        same ? ": all points of a page have the same" : "");
  }
  if (!why["emits"].get<bool>()) text += "  emission  none is stored: no point emits light\n";
  text += fmt::format("  leaves    of at most {} points: {:.3f} nodes a point\n",
                      why["leaf_points"].dump(), why["nodes_per_point"].get<double>());
  return text;
}

}  // namespace ptc
