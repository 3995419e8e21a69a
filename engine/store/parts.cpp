// A scene of parts as one container (spec/parts.md): opening the parts, and the numbers by which
// their pages, points and groups are known in the scene.
//
//   ranks of point pages   | part 0: 0 1 2 | part 1: 3 4 | ...
//   ranks of node pages    | own: 0 1 | part 0: 2 3 4 | part 1: 5 6 | ...
//   numbers of points      rank of the point page * points_per_page + place on the page
#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>

#include "engine/io/file/url.h"
#include "engine/store/clauses.h"
#include "engine/store/commit.h"
#include "engine/store/reader.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kParts[] = "spec/parts.md#parts-page";
constexpr char kCount[] = "spec/parts.md#parts-count";
constexpr char kFile[] = "spec/parts.md#parts-file";

/// Returns how a part's file differs from what the scene says of it; empty when it does not.
std::string difference(const ContainerReader& scene, const PartRecord& record,
                       const ContainerReader& part) {
  const Superblock& s = part.superblock();
  const Frame &frame = scene.header().frame, &other = part.header().frame;
  if (part.header().uuid != record.uuid) return "it has another uuid";
  if (s.file_bytes != record.file_bytes) return "it has another length";
  if (s.xxh3 != record.superblock_xxh3) return "it has another superblock";
  if (s.points != record.points) return "it has another number of points";
  if (s.node_pages != record.node_pages) return "it has another number of node pages";
  if (other.origin != frame.origin || other.edge != frame.edge) return "it has another frame";
  if (part.header().page_shift != scene.header().page_shift) return "it has another page size";
  if (part.header().point_bytes != scene.header().point_bytes) return "its points have other bytes";
  if (s.leaf_points != scene.superblock().leaf_points) return "it has leaves of another size";
  if (part.meta().channels != scene.meta().channels) return "it has other channels";
  return {};
}

/// Calls change(group, i, reference) for each child of each group of a payload, and stores the
/// reference that it returns.
template <class Change>
void change_references(std::span<std::byte> payload, std::uint32_t groups, const Change& change) {
  const NodePage nodes(payload.data(), groups);
  for (std::uint32_t slot = 0; slot < groups; ++slot) {
    const GroupView group = nodes[slot];
    const auto at = static_cast<std::size_t>(group.bytes().data() - payload.data());
    for (int i = 0; i < group.size(); ++i)
      set_reference(payload.subspan(at), i, change(group.child(i)));
  }
}

}  // namespace

void ContainerReader::open_parts() {
  const PartList list = read_parts();
  if (list.points() != superblock_.points) {
    throw FormatError(superblock_.file_bytes - 2 * kBlockBytes, kCount,
                      "superblock says " + std::to_string(superblock_.points) +
                          " points, the parts have " + std::to_string(list.points()))
        .rebased(0, path().string());
  }
  for (const PartRecord& record : list.parts()) open_part(record);
  std::uint64_t groups = 0;
  for (const std::uint32_t page : node_pages()) groups += entries_[page].record_count;
  for (const auto& part : parts_) groups += part->superblock().node_groups;
  if (superblock_.node_groups != groups) {
    throw FormatError(superblock_.file_bytes - 2 * kBlockBytes, clause::kSuperblockCounts,
                      "superblock says " + std::to_string(superblock_.node_groups) +
                          " node groups, the scene and its parts have " + std::to_string(groups))
        .rebased(0, path().string());
  }
  join_parts();
}

/// Reads the records of the parts.
PartList ContainerReader::read_parts() const {
  PartList list(superblock_.node_pages);
  const PageNumbers::Range others = numbers_.others();
  const std::size_t full = page_payload_limit() / kPartBytes;
  std::vector<std::byte> payload(page_payload_limit());
  PageDecoder decoder;
  std::uint32_t pages = 0;
  for (const std::uint32_t page : others) {
    if (entries_[page].type != PageType::parts) break;
    if (pages++ > 0 && entries_[page - 1].record_count != full) {
      throw FormatError(entries_[page - 1].offset, kParts, "a parts page but the last is not full")
          .rebased(0, path().string())
          .in_page(page - 1);
    }
    const PageHeader header = read_page(page, payload, decoder);
    at_page(file_, entries_[page].offset, page, [&] {
      try {
        list.add_page(std::span(payload).first(header.raw_bytes));
      } catch (const FormatError& error) {
        throw placed_in_page(error, header);
      }
    });
  }
  if (list.parts().empty() || superblock_.point_pages > 0) {
    throw FormatError(superblock_.file_bytes - 2 * kBlockBytes, kParts,
                      "a scene of parts has no part, or has points of its own")
        .rebased(0, path().string());
  }
  return list;
}

void ContainerReader::open_part(const PartRecord& record) {
  const std::filesystem::path name = file_beside(path(), record.name);
  const auto refuse = [&](const std::string& what) {
    throw FormatError(0, kFile, "is not the part that " + path().string() + " names: " + what)
        .rebased(0, name.string());
  };
  try {
    // Look at the header first: a scene that names itself would open itself without end.
    if (read_file_header(InputFile(name)).has_parts()) refuse("it is a scene of parts itself");
    parts_.push_back(std::make_unique<const ContainerReader>(name));
  } catch (const std::system_error& error) {
    if (is_file(name)) throw;
    refuse("there is no such file");
  }
  const ContainerReader& part = *parts_.back();
  if (const std::string what = difference(*this, record, part); !what.empty()) refuse(what);
  const PageNumbers::Range points = part.point_pages();
  if (part.entry(points[0]).first_key != record.first_key.high ||
      part.read_page_header(points[points.size() - 1]).last_key != record.last_key.high)
    refuse("its points have other keys");
}

/// Makes one directory of those of the parts and the scene's own, and counts what is in it.
void ContainerReader::join_parts() {
  // Find where each part begins.
  places_ = {{.first_node_page = superblock_.node_pages}};
  for (const auto& part : parts_) {
    const Superblock& s = part->superblock();
    const PartPlace& at = places_.back();
    const std::uint32_t point_page = at.first_point_page + s.point_pages;
    places_.push_back({at.first_point + s.points, point_page * points_per_page(header_), point_page,
                       at.first_node_page + s.node_pages});
  }
  // Gather the entries.
  std::vector<DirectoryEntry> entries;
  const auto add = [&](const ContainerReader& from, const PageNumbers::Range& pages) {
    for (const std::uint32_t page : pages) entries.push_back(from.entries_[page]);
  };
  for (const auto& part : parts_) add(*part, part->point_pages());
  std::vector<std::uint8_t> channels = channel_groups(meta_.channels);
  for (const std::uint8_t group : channels) {
    for (const auto& part : parts_) add(*part, part->attribute_pages(group));
  }
  add(*this, node_pages());
  for (const auto& part : parts_) add(*part, part->node_pages());
  const PageNumbers::Range others = numbers_.others();
  add(*this, {others.first, others.count + 1});  // and the meta page
  entries_ = std::move(entries);
  superblock_.page_count = static_cast<std::uint32_t>(entries_.size());
  superblock_.point_pages = places_.back().first_point_page;
  superblock_.node_pages = places_.back().first_node_page;
  numbers_ = PageNumbers(superblock_, std::move(channels));
}

std::uint32_t ContainerReader::own_number(std::uint32_t page) const {
  if (const std::optional<PartPage> at = part_page(page)) return at->page;
  if (parts_.empty()) return page;
  const std::uint32_t own_nodes = places_.front().first_node_page;
  const std::uint32_t others = numbers_.others().first;
  return page < others ? page - numbers_.nodes().first : page - others + own_nodes;
}

std::uint32_t ContainerReader::number_of(std::uint32_t own) const {
  if (parts_.empty()) return own;
  const std::uint32_t own_nodes = places_.front().first_node_page;
  return own < own_nodes ? own + numbers_.nodes().first : own - own_nodes + numbers_.others().first;
}

std::uint64_t ContainerReader::next_point(std::uint64_t end) const {
  if (parts_.empty()) return end;
  const auto behind = std::ranges::lower_bound(places_, end, {}, &PartPlace::first_number);
  if (behind == places_.begin() || behind == places_.end()) return end;
  const PartPlace& part = *(behind - 1);
  const std::uint64_t points = behind->first_point - part.first_point;
  return end == part.first_number + points ? behind->first_number : end;
}

std::uint64_t ContainerReader::without_gaps(std::uint64_t point) const {
  if (parts_.empty()) return point;
  const PartPlace& place =
      *(std::ranges::upper_bound(places_, point, {}, &PartPlace::first_number) - 1);
  return point - place.first_number + place.first_point;
}

/// Returns where a page lies among the parts, or nothing when it is the scene's own.
std::optional<ContainerReader::PartPage> ContainerReader::part_page(std::uint32_t page) const {
  if (parts_.empty() || page >= numbers_.others().first) return std::nullopt;
  const bool node = numbers_.nodes().contains(page);
  const std::uint32_t rank = rank_of(numbers_, entries_, page);
  const auto first = node ? &PartPlace::first_node_page : &PartPlace::first_point_page;
  if (node && rank < places_.front().first_node_page) return std::nullopt;
  const auto behind = std::ranges::upper_bound(places_, rank, {}, first);
  const auto part = static_cast<std::size_t>(behind - places_.begin() - 1);
  const std::uint32_t local = rank - places_[part].*first;
  const ContainerReader& file = *parts_[part];
  if (node) return PartPage{part, file.node_pages()[local]};
  if (numbers_.points().contains(page)) return PartPage{part, file.point_pages()[local]};
  return PartPage{part, file.attribute_pages(entries_[page].group)[local]};
}

/// Changes the references of a part's node page to those of the scene.
void ContainerReader::renumber(std::span<std::byte> payload, std::uint32_t groups,
                               std::size_t part) const {
  const PartPlace& place = places_[part];
  change_references(payload, groups, [&](ChildRef ref) {
    if (ref.interior) {
      ref.page += place.first_node_page;
    } else {
      ref.first_point += place.first_number;
    }
    return ref;
  });
}

/// Changes the runs of points on the scene's own node pages, whose numbers have no gaps.
void ContainerReader::renumber_top(std::span<std::byte> payload, std::uint32_t groups) const {
  change_references(payload, groups, [&](ChildRef ref) {
    if (ref.interior) return ref;
    const auto behind =
        std::ranges::upper_bound(places_, ref.first_point, {}, &PartPlace::first_point);
    const PartPlace& place = *(behind - 1);
    if (behind == places_.end() || ref.first_point + ref.point_count > behind->first_point)
      throw FormatError(0, clause::kPartsTop, "a leaf has points of two parts");
    ref.first_point += place.first_number - place.first_point;
    return ref;
  });
}

}  // namespace ptc
