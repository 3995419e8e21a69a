#include "format/parts_page.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "format/bytes.h"
#include "format/error.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr char kCount[] = "spec/parts.md#parts-count";
constexpr char kOrder[] = "spec/parts.md#parts-order";
constexpr char kName[] = "spec/parts.md#parts-name";
constexpr char kZero[] = "spec/parts.md#parts-zero";

constexpr std::size_t kReservedAt = 88;
constexpr std::size_t kNameAt = 128;
constexpr std::uint64_t kMaxPoints = std::uint64_t{1} << 48;
constexpr std::uint64_t kKeyEnd = std::uint64_t{1} << 63;  // greatest half of a key, and 1

namespace field {
constexpr Field<std::uint64_t> kSuperblock{16};
constexpr Field<std::uint64_t> kFileBytes{24};
constexpr Field<std::uint64_t> kFirstPoint{32};
constexpr Field<std::uint64_t> kPoints{40};
constexpr Field<std::uint32_t> kFirstNodePage{48};
constexpr Field<std::uint32_t> kNodePages{52};
constexpr Field<std::uint64_t> kFirstKeyHigh{56};
constexpr Field<std::uint64_t> kFirstKeyLow{64};
constexpr Field<std::uint64_t> kLastKeyHigh{72};
constexpr Field<std::uint64_t> kLastKeyLow{80};
}  // namespace field

/// Says whether a name leads to a file in the scene's folder or below it.
bool stays_below(std::string_view name) {
  for (std::size_t begin = 0;;) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    const std::string_view step = name.substr(begin, end - begin);
    if (step.empty() || step == "." || step == "..") return false;
    if (end == name.size()) return true;
    begin = end + 1;
  }
}

std::string decode_name(std::span<const std::byte> record) {
  const auto bytes = record.subspan(kNameAt);
  const std::string_view text = as_text(bytes);
  const std::string name(text.substr(0, text.find('\0')));
  if (name.size() == bytes.size() || !is_utf8(name) || !stays_below(name))
    throw FormatError(kNameAt, kName, "the name is no path below the scene's folder");
  const std::size_t rest = name.size() + first_nonzero(bytes.subspan(name.size()));
  if (rest != bytes.size())
    throw FormatError(kNameAt + rest, kName, "bytes behind the name are not zero");
  return name;
}

}  // namespace

PartRecord decode_part(std::span<const std::byte> record) {
  const std::byte* const p = record.data();
  PartRecord part;
  std::memcpy(part.uuid.data(), p, part.uuid.size());
  part.superblock_xxh3 = field::kSuperblock.of(p);
  part.file_bytes = field::kFileBytes.of(p);
  part.first_point = field::kFirstPoint.of(p);
  part.points = field::kPoints.of(p);
  part.first_node_page = field::kFirstNodePage.of(p);
  part.node_pages = field::kNodePages.of(p);
  part.first_key = {field::kFirstKeyHigh.of(p), field::kFirstKeyLow.of(p)};
  part.last_key = {field::kLastKeyHigh.of(p), field::kLastKeyLow.of(p)};
  const std::size_t set =
      kReservedAt + first_nonzero(record.subspan(kReservedAt, kNameAt - kReservedAt));
  if (set != kNameAt) throw FormatError(set, kZero, "a reserved byte is not zero");
  part.name = decode_name(record);
  return part;
}

void append_part(const PartRecord& part, std::vector<std::byte>& out) {
  if (part.name.size() >= kPartBytes - kNameAt)
    throw std::invalid_argument("append_part: the name has more than 255 bytes");
  const std::size_t at = out.size();
  out.resize(at + kPartBytes);
  std::byte* const p = out.data() + at;
  std::memcpy(p, part.uuid.data(), part.uuid.size());
  field::kSuperblock.put(p, part.superblock_xxh3);
  field::kFileBytes.put(p, part.file_bytes);
  field::kFirstPoint.put(p, part.first_point);
  field::kPoints.put(p, part.points);
  field::kFirstNodePage.put(p, part.first_node_page);
  field::kNodePages.put(p, part.node_pages);
  field::kFirstKeyHigh.put(p, part.first_key.high);
  field::kFirstKeyLow.put(p, part.first_key.low);
  field::kLastKeyHigh.put(p, part.last_key.high);
  field::kLastKeyLow.put(p, part.last_key.low);
  std::memcpy(p + kNameAt, part.name.data(), part.name.size());
}

void PartList::add_page(std::span<const std::byte> payload) {
  for (std::size_t at = 0; at < payload.size(); at += kPartBytes) {
    try {
      PartRecord part = decode_part(payload.subspan(at, kPartBytes));
      check_sums(part);
      check_order(part);
      if (!names_.insert(part.name).second)
        throw FormatError(kNameAt, kName, "two parts have the name " + part.name);
      points_ += part.points;
      node_pages_ += part.node_pages;
      parts_.push_back(std::move(part));
    } catch (const FormatError& error) {
      throw error.rebased(at, "");
    }
  }
}

/// Checks that the part begins where the one before ends.
void PartList::check_sums(const PartRecord& part) const {
  if (part.first_point != points_)
    throw FormatError(field::kFirstPoint.at, kCount, "first_point is not the sum of points before");
  if (part.points == 0 || part.points > kMaxPoints - points_)
    throw FormatError(field::kPoints.at, kCount, "the part is empty, or has too many points");
  if (part.first_node_page != node_pages_)
    throw FormatError(field::kFirstNodePage.at, kCount,
                      "first_node_page is not the sum of node pages before");
  if (part.node_pages > kMaxPages - node_pages_)
    throw FormatError(field::kNodePages.at, kCount, "there are more than 2^32 - 2 node pages");
}

void PartList::check_order(const PartRecord& part) const {
  const std::array halves{part.first_key.high, part.first_key.low, part.last_key.high,
                          part.last_key.low};
  for (std::size_t i = 0; i < halves.size(); ++i) {
    if (halves[i] >= kKeyEnd)
      throw FormatError(field::kFirstKeyHigh.at + 8 * i, kOrder, "half of a key is 2^63 or more");
  }
  if (part.last_key < part.first_key)
    throw FormatError(field::kLastKeyHigh.at, kOrder, "last_key is below first_key");
  if (!parts_.empty() && part.first_key <= parts_.back().last_key)
    throw FormatError(field::kFirstKeyHigh.at, kOrder,
                      "the part does not begin behind the end of the one before");
}

}  // namespace ptc
