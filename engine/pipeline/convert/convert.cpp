// A container becomes another container in one of two ways. copy_pages() decodes and encodes each
// page under its old number. rebuild_pages() streams the points through the octree builder, because
// another page size or rounded points make other pages, and moves the channels to pages of the new
// length.
#include "engine/pipeline/convert/convert.h"

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "engine/io/file/file.h"
#include "engine/io/text/text.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/channel_pager.h"
#include "engine/octree/flat_cells.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/convert/rim_rays.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/commit.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "format/point_page.h"

namespace ptc {
namespace {

/// Returns the UUID of the copy. It is another one than that of the original, whose pages must not
/// pass for pages of the copy.
Uuid derived_uuid(const ContainerReader& container, const RecodeOptions& options,
                  std::uint8_t page_shift) {
  std::vector<std::byte> text(sizeof(Uuid) + 2 + options.simplified.size());
  const auto rest = std::ranges::copy(container.header().uuid, text.begin()).out;
  rest[0] = static_cast<std::byte>(options.profile);
  rest[1] = static_cast<std::byte>(page_shift);
  std::ranges::copy(std::as_bytes(std::span(options.simplified)), rest + 2);
  return uuid_of(text);
}

/// Copies all pages but the meta page, with their ranks and in the order in which they lie in the
/// file; those of the tail last, into the tail.
void copy_pages(const ContainerReader& container, ContainerWriter& writer, Progress& progress) {
  // Order the pages, and reserve their ranks
  const std::uint32_t tail =
      container.page_count() - static_cast<std::uint32_t>(container.superblock().tail.size());
  std::vector<std::uint32_t> order(container.meta_page());
  std::iota(order.begin(), order.end(), 0U);
  for (const std::uint32_t page : order) {
    const DirectoryEntry& entry = container.entry(page);
    static_cast<void>(writer.reserve_page(entry.type, entry.group));
  }
  std::ranges::sort(order, {}, [&](std::uint32_t page) {
    return std::pair(page >= tail, container.entry(page).offset);
  });
  // Decode them, and write them again
  PageDecoder decoder;
  std::vector<std::byte> payload(container.page_payload_limit());
  for (const std::uint32_t page : order) {
    const PageHeader header = container.read_page(page, payload, decoder);
    const auto content = std::span<const std::byte>(payload).first(header.raw_bytes);
    if (container.entry(page).is_void()) {
      writer.write_void_page(summary_of(header));
    } else if (page >= tail) {
      writer.keep_page(summary_of(header), content);
    } else {
      writer.write_page(summary_of(header), content, container.attribute_columns(header.group));
    }
    if (header.type == PageType::point) progress.advance(header.record_count);
  }
}

/// Writes the channels of a container again, on pages as long as those of the writer.
void repage_channels(const ContainerReader& container, ContainerWriter& writer) {
  const std::uint32_t full = points_per_page(writer.header());
  for (const std::uint8_t group : container.groups()) {
    PageDecoder decoder;
    const PageNumbers::Range pages = container.attribute_pages(group);
    std::size_t read = 0;
    const auto next_page = [&](std::span<std::byte> payload) {
      return container.read_page(pages[read++], payload, decoder).record_count;
    };
    ChannelPager pager(container.attribute_columns(group), container.page_payload_limit(),
                       next_page);
    for (std::uint64_t left = container.superblock().points; left > 0;) {
      const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(full, left));
      writer.write_attributes(group, pager.next(count), count, container.meta().channels);
      left -= count;
    }
  }
}

/// Says whether surfels are merged: those of a container with channels are not, since these have
/// values for each.
bool merges_points(const Simplification& simplification, const ContainerReader& container) {
  return simplification.merging.growth > 1 && container.meta().channels.empty();
}

/// Builds the octree again from the points of a container, and moves its channels.
/// @param rounding  of the points; empty: none
/// @param merged    what a simplification has merged
Superblock rebuild_pages(const ContainerReader& container, ContainerWriter& writer,
                         const std::optional<PointRounding>& rounding,
                         const std::optional<Simplification>& simplification, MergeCounts& merged,
                         const Executor& executor, Progress& progress) {
  const double unit = container.header().frame.unit();
  ContainerPoints all(container);
  const BuildOptions tree{.leaf_points = simplification
                                             ? simplification->leaf_points
                                             : std::max(1U, container.superblock().leaf_points)};
  const bool merges = simplification && merges_points(*simplification, container);
  std::optional<RimRays> rim;
  if (merges) rim.emplace(container);
  const SurfaceGoesOn goes_on = [&](const PointRecord& disc, float finest) {
    return rim->meet(disc, finest);
  };
  const std::unique_ptr<PointStream> flat =
      merges ? merge_flat_cells(all, unit, simplification->merging, goes_on, merged) : nullptr;
  PointStream& points = flat ? *flat : all;
  const std::unique_ptr<PointStream> rounded =
      rounding ? round_points(points, unit, executor, {}, *rounding) : nullptr;
  const Superblock superblock =
      build_pages(rounded ? *rounded : points, writer, tree, executor, progress);
  repage_channels(container, writer);
  return superblock;
}

Superblock write_container(const ContainerReader& container, const std::filesystem::path& target,
                           const RecodeOptions& options, MergeCounts& merged, Progress& progress) {
  at_offset(container.file(), 0, [&] { check_copyable(container.header()); });
  // Complete the record: rounding is noted once
  const FileHeader& from = container.header();
  const std::uint8_t page_shift = options.page_shift.value_or(from.page_shift);
  Meta meta = container.meta();
  std::optional<PointRounding> rounding;
  if (options.simplification) {
    rounding = options.simplification->rounding;
    // What was simplified before stays as coarse as it is
    std::string text = rounding_text(*rounding);
    if (meta.text.contains(kSimplifiedKey)) text += "; before: " + meta.text[kRoundingKey];
    meta.text[kRoundingKey] = text;
    meta.text[kSimplifiedKey] = options.simplified;
  } else if (is_rounded(options.profile) &&
             meta.text.try_emplace(kRoundingKey, rounding_text()).second) {
    rounding.emplace();
  }
  check_meta(meta, page_shift, from.point_bytes);

  // Check the memory cap
  const ThreadPool executor(options.run.threads);
  const std::uint64_t pages =
      (std::uint64_t{container.page_count()} << from.page_shift >> page_shift) +
      container.page_count();
  MemoryBudget budget = budget_of(options.run.memory_bytes, "this conversion");
  charge_directory(budget, container);
  budget.charge("pages that are written",
                ContainerWriter::memory_bytes(pages, page_shift, executor.threads()));
  const bool same_pages = page_shift == from.page_shift && !rounding && container.parts().empty();
  if (!same_pages) budget.charge("node pages that wait", held_pages_bytes(page_shift));
  if (options.simplification && merges_points(*options.simplification, container))
    budget.charge("rays at the surfels", RimRays::least_bytes(container));
  budget.require();

  // Copy the pages where they stay as they are, build them again elsewhere
  ContainerWriter writer(target, {.page_shift = page_shift,
                                  .codec = codec_of(options.profile),
                                  .uuid = derived_uuid(container, options, page_shift),
                                  .frame = from.frame,
                                  .point_bytes = from.point_bytes,
                                  .source = &container.file()});
  Superblock superblock = container.superblock();
  if (same_pages) {
    copy_pages(container, writer, progress);
  } else {
    superblock = rebuild_pages(container, writer, rounding, options.simplification, merged,
                               executor, progress);
    superblock.writer.clear();
  }
  return writer.finish(meta, superblock);
}

}  // namespace

bool is_container(const std::filesystem::path& path) {
  if (lower_extension(path) == ".ptcx") return true;
  static const Block example = encode_file_header({});
  std::array<std::byte, 8> magic{};
  const InputFile file(path);
  if (file.size() < magic.size()) return false;
  file.read_at(0, magic);
  return std::equal(magic.begin(), magic.end(), example.begin());
}

ConvertReport recode_container(const ContainerReader& container,
                               const std::filesystem::path& target, const RecodeOptions& options,
                               Progress& progress) {
  ConvertReport report{.points = container.superblock().points};
  {
    const Stage stage(report.seconds, progress, "convert", report.points, "points");
    report.superblock = write_container(container, target, options, report.merged, progress);
    report.points = report.superblock->points;
  }
  return report;
}

}  // namespace ptc
