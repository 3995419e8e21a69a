// Builds a new file from the pages whose checksums hold (spec/recovery.md#salvage).
//
// Points carry over page by page, and the octree is built again from them. Channel values belong to
// points by rank: the attribute page of rank k of a group holds the values of the point page of
// rank k. Every page tells its rank:
//
//   rank               0        1        2        3
//   point pages     [ kept ] [ lost ] [ kept ] [ kept ]  ->  points of ranks 0, 2, 3
//   attribute pages [ kept ] [ kept ] [ lost ] [ kept ]  ->  values of 0 and 3, unknown for rank 2
#include "engine/verify/salvage.h"

#include <algorithm>
#include <map>
#include <optional>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory_budget.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/channel_pager.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/writer.h"
#include "engine/verify/surveyed_page.h"
#include "format/bytes.h"
#include "format/checksum.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint64_t kBaseBytes = std::uint64_t{32} << 20;  // program, libraries, small buffers
// Memory for each page of the file: its site, twice where pages moved, and entries of two maps.
constexpr std::uint64_t kPageBytes = 320;
constexpr std::uint64_t kPagesOpen =
    80;  // pages that the build holds: one for each level, and some

/// A page that the file has or had.
struct Known {
  const PageSite* site = nullptr;  ///< an intact copy of the page; null when it is lost
  MortonKey first_key, last_key;   ///< keys of the first and last point of an intact point page
};

/// Streams the points of the kept pages, page by page.
class KeptPoints : public PointStream {
 public:
  KeptPoints(SurveyedPage& page, FlipBudget& flips,
             const std::map<std::uint64_t, const PageSite*>& pages)
      : page_(page), flips_(flips), next_(pages.begin()), end_(pages.end()) {}

  std::size_t next(std::span<PointRecord> out) override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (at_ == count_) {
        if (next_ == end_) break;
        const PageSite& site = *(next_++)->second;
        if (const auto finding = page_.check(site, 3, flips_)) throw DataError(line_of(*finding));
        count_ = site.entry.record_count;
        at_ = 0;
      }
      const PointPage points(page_.payload().data(), count_, page_.point_bytes());
      while (at_ < count_ && filled < out.size()) out[filled++] = points[at_++];
    }
    return filled;
  }

 private:
  SurveyedPage& page_;
  FlipBudget& flips_;
  std::map<std::uint64_t, const PageSite*>::const_iterator next_, end_;
  std::uint32_t count_ = 0, at_ = 0;
};

/// One salvage, from the survey of the damaged file to the finished new one.
class Salvage {
 public:
  Salvage(const std::filesystem::path& path, const SalvageOptions& options, Progress& progress)
      : file_(path), options_(options), progress_(progress), flips_(options.flip_budget) {}

  SalvageReport run(const std::filesystem::path& target) {
    // Survey the damaged file.
    Findings ignored(0, false);
    survey_ = survey_file(file_, ignored, flips_, false, progress_);
    require_what_it_takes();
    page_.emplace(file_, survey_, true);
    // Choose the pages to keep.
    find_meta();
    for (const auto& [group, columns] : survey_.columns) by_group_[group];
    find_sound_pages();
    choose_pages();
    if (points_.empty())
      refuse("spec/recovery.md#survey", "no point page is intact, so there is nothing to salvage");
    // Write them as a new file.
    write(target);
    return report_;
  }

 private:
  [[noreturn]] void refuse(const char* rule, const std::string& text) const {
    throw FormatError(0, rule, text).rebased(0, file_.path().string());
  }

  /// Refuses a file without an identity, one with a feature that forbids repair, and a cap that is
  /// too small.
  void require_what_it_takes() const {
    if (!survey_.header)
      refuse("spec/recovery.md#survey",
             "neither the header nor a superblock is whole, so no page can be shown to belong to "
             "this file");
    if ((survey_.header->feature_incompat & kPartsFeature) != 0)
      refuse(
          "spec/recovery.md#salvage",
          "a scene of parts has no points of its own: salvage the part that is damaged, or build "
          "the scene again from its parts");
    if (survey_.header->feature_ro_compat != 0)
      refuse("spec/versions.md#features",
             "the file uses a feature that forbids repairing it: use the program that wrote it");
    const std::uint64_t page = std::uint64_t{1} << survey_.header->page_shift;
    MemoryBudget budget(options_.memory_bytes, "the salvage of this file", "memory_bytes");
    budget.charge("the program", kBaseBytes);
    budget.charge("the list of pages",
                  kPageBytes * (survey_.sites.size() + survey_.void_pages.size()));
    budget.charge("open pages", kPagesOpen * page);
    budget.require();
  }

  using Sites = std::map<std::uint32_t, Known>;  ///< by rank

  /// Returns the map for pages of this kind; null for pages that a salvage does not keep.
  Sites* kind_of(const DirectoryEntry& entry) {
    if (entry.type == PageType::point) return &point_sites_;
    const bool wanted = entry.type == PageType::attribute && by_group_.contains(entry.group);
    return wanted ? &attribute_sites_[entry.group] : nullptr;
  }

  /// Finds an intact copy of every page. Where several sites have one rank, the first intact one
  /// counts. A page that is not in its place may lie elsewhere, as after a swap of two pages.
  void find_sound_pages() {
    // Check all pages where they should lie.
    progress_.begin("check pages", survey_.sites.size(), "pages");
    bool lost = false;
    for (const PageSite& site : survey_.sites) {
      lost |= !consider(site);
      progress_.advance(1);
    }
    progress_.end();
    if (!lost) return;
    // Search the whole file for the lost ones. What the directory says of a page, other than its
    // place, must hold for the copy too.
    moved_ = find_pages(file_, *survey_.header, progress_);
    std::map<std::uint64_t, const DirectoryEntry*> listed;
    for (const PageSite& site : survey_.sites) {
      if (site.listed) listed[site.identity()] = &site.entry;
    }
    for (const PageSite& site : moved_) {
      const auto said = listed.find(site.identity());
      DirectoryEntry here = site.entry;
      if (said != listed.end()) here.offset = said->second->offset;
      if (said == listed.end() || here == *said->second) consider(site);
    }
  }

  /// Takes the page of a site, unless an intact copy of that page is known already.
  /// @return  false when the page is wanted but is not intact here
  bool consider(const PageSite& site) {
    Sites* const kind = kind_of(site.entry);
    if (kind == nullptr) return true;
    Known& known = (*kind)[site.rank];
    if (known.site != nullptr) return true;
    if (page_->check(site, 3, flips_)) return false;
    known.site = &site;
    if (site.entry.type == PageType::point) {
      const PointPage points(page_->payload().data(), site.entry.record_count,
                             survey_.header->point_bytes);
      known.first_key = points[0].key;
      known.last_key = points[site.entry.record_count - 1].key;
    }
    return true;
  }

  /// Chooses the pages to keep: point pages whose keys do not lie before the page in front, and the
  /// attribute pages next to them.
  void choose_pages() {
    MortonKey last_key;
    for (const auto& [rank, page] : point_sites_) {
      if (page.site == nullptr || page.first_key < last_key) continue;
      last_key = page.last_key;
      points_[rank] = page.site;
    }
    const std::optional<Superblock>& s = survey_.superblock;
    const std::uint64_t pages = s ? s->point_pages : point_sites_.size();
    report_.point_pages_before = pages;
    report_.point_pages = points_.size();
    if (s) report_.points_before = s->points;
    for (const PageSite& page : survey_.void_pages) {  // no damage can reach these
      if (by_group_.contains(page.entry.group) && points_.contains(page.rank))
        ++report_.attribute_pages;
    }
    for (auto& [group, kept] : by_group_) {
      report_.attribute_pages_before += pages;
      for (const auto& [rank, page] : attribute_sites_[group]) {
        const auto beside = points_.find(rank);
        if (page.site == nullptr || beside == points_.end()) continue;
        if (page.site->entry.record_count != beside->second->entry.record_count) continue;
        kept[rank] = page.site;
        ++report_.attribute_pages;
      }
    }
  }

  /// Reads the meta page once more, because this time a flipped bit in it can be turned back.
  void find_meta() {
    for (const PageSite& site : survey_.sites) {
      if (site.entry.type != PageType::meta || page_->check(site, 3, flips_)) continue;
      try {
        survey_.meta = decode_meta(page_->payload(), survey_.header->point_bytes);
        survey_.columns = columns_by_group(survey_.meta);
        report_.meta = true;
      } catch (const FormatError&) {  // the meta page is lost
      }
    }
  }

  void write(const std::filesystem::path& target) {
    // Open a file with the old frame and page size, and a uuid of its own.
    const std::optional<Superblock>& before = survey_.superblock;
    ContainerWriter writer(target, {.page_shift = survey_.header->page_shift,
                                    .codec = codec(),
                                    .uuid = new_uuid(),
                                    .frame = survey_.header->frame,
                                    .point_bytes = survey_.header->point_bytes});
    // Write the points and their octree, then the channels.
    BuildOptions tree;
    if (before) tree.leaf_points = std::max(1U, before->leaf_points);
    KeptPoints points(*page_, flips_, points_);
    progress_.begin("build", points_.size() * points_per_page(*survey_.header), "points");
    Superblock after = build_pages(points, writer, tree, ThreadPool(options_.threads), progress_);
    progress_.end();
    for (const auto& [group, kept] : by_group_) write_channels(writer, group, kept, after.points);
    // Record in the meta page what was kept, and publish the file.
    Meta meta = survey_.meta;
    meta.text.insert_or_assign(
        "salvaged", fmt::format("{} of {} points, {} of {} pages of channels", after.points,
                                before ? std::to_string(before->points) : "an unknown number of",
                                report_.attribute_pages, report_.attribute_pages_before));
    report_.superblock = writer.finish(meta, std::move(after));
    report_.points = report_.superblock.points;
    // Report the kept shares of area and flux.
    const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 1.0; };
    const auto flux = [](const Superblock& s) { return s.flux[0] + s.flux[1] + s.flux[2]; };
    if (!before) return;
    report_.area_share = share(report_.superblock.area, before->area);
    report_.flux_share = share(flux(report_.superblock), flux(*before));
  }

  /// Writes the attribute pages of one group. Its kept pages are as long as the old point pages, of
  /// which some are lost, so their columns move to pages of the new length.
  /// @param kept    attribute pages by rank; values of ranks that are missing are not known
  /// @param points  in the new file
  void write_channels(ContainerWriter& writer, std::uint8_t group,
                      const std::map<std::uint64_t, const PageSite*>& kept, std::uint64_t points) {
    const std::vector<PackedColumn>& columns = survey_.columns.at(group);
    auto beside = points_.begin();
    const auto next_page = [&](std::span<std::byte> payload) {
      const auto& [rank, site] = *beside++;
      const std::size_t bytes = group_point_bytes(survey_.meta.channels, group);
      fill_void(survey_.meta.channels, group, payload.first(bytes * site->entry.record_count));
      const auto found = kept.find(rank);
      if (found != kept.end() && !page_->check(*found->second, 3, flips_))
        std::ranges::copy(page_->payload(), payload.begin());
      return site->entry.record_count;
    };
    ChannelPager pager(columns, payload_limit(survey_.header->page_shift), next_page);
    const std::uint32_t full = points_per_page(writer.header());
    for (std::uint64_t left = points; left > 0;) {
      const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(full, left));
      writer.write_attributes(group, pager.next(count), count, survey_.meta.channels);
      left -= count;
    }
  }

  /// Returns the codec of the first kept point page, which the new file uses throughout.
  Codec codec() {
    static_cast<void>(page_->check(*points_.begin()->second, 1, flips_));
    return page_->header().coding.codec;
  }

  /// Derives the uuid of the new file from the old one and the kept points. It differs from the old
  /// one, so that no page of the damaged file can pass for a page of the new one.
  Uuid new_uuid() const {
    std::vector<std::byte> text(survey_.header->uuid.begin(), survey_.header->uuid.end());
    for (const auto& [rank, site] : points_) {
      text.resize(text.size() + 8);
      store(text.data(), text.size() - 8, site->entry.payload_xxh3);
    }
    return uuid_of(text);
  }

  InputFile file_;
  SalvageOptions options_;
  Progress& progress_;
  FlipBudget flips_;
  Survey survey_;
  std::optional<SurveyedPage> page_;
  std::vector<PageSite> moved_;                      ///< pages that a scan of the file found
  Sites point_sites_;                                ///< point pages
  std::map<std::uint8_t, Sites> attribute_sites_;    ///< attribute pages, by group
  std::map<std::uint64_t, const PageSite*> points_;  ///< kept point pages, by rank
  std::map<std::uint8_t, std::map<std::uint64_t, const PageSite*>>
      by_group_;  ///< kept attribute pages, by group and rank
  SalvageReport report_;
};

}  // namespace

SalvageReport salvage_container(const std::filesystem::path& path,
                                const std::filesystem::path& target, const SalvageOptions& options,
                                Progress& progress) {
  std::error_code absent;
  if (std::filesystem::equivalent(path, target, absent)) {
    throw RequestError("target", "a salvage cannot write to the damaged file itself, " +
                                     path.string() + ": choose another file");
  }
  return Salvage(path, options, progress).run(target);
}

}  // namespace ptc
