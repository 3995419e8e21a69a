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
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory_budget.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/channel_pager.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/commit.h"
#include "engine/store/writer.h"
#include "engine/verify/survey.h"
#include "engine/verify/surveyed_page.h"
#include "format/bytes.h"
#include "format/checksum.h"
#include "format/parts_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

// Memory for each page of the file: its site, twice where pages moved, and entries of two maps.
constexpr std::uint64_t kPageBytes = 320;
constexpr std::uint64_t kPagesOpen =
    80;  // pages that the build holds: one for each level, and some

/// Refuses to write over a file that is read.
void require_other_file(const std::filesystem::path& path, const std::filesystem::path& target) {
  std::error_code absent;
  if (std::filesystem::equivalent(path, target, absent)) {
    throw RequestError("target", "a salvage cannot write to the damaged file itself, " +
                                     path.string() + ": choose another file");
  }
}

/// A page that a file has or had.
struct Known {
  const PageSite* site = nullptr;  ///< an intact copy of the page; null when it is lost
  MortonKey first_key, last_key;   ///< keys of the first and last point of an intact point page
};
using KnownPages = std::map<std::uint32_t, Known>;  ///< by rank

/// What is left of one file: its survey, and the pages that are intact. Bits whose flip makes a
/// checksum right are flipped back.
class Remains {
 public:
  /// Surveys a file.
  /// @param flips, progress  must outlive this
  Remains(const std::filesystem::path& path, FlipBudget& flips, Progress& progress)
      : file_(path), flips_(flips), progress_(progress) {
    Findings findings(1, false);
    survey_ = survey_file(file_, findings, flips_, false, progress_);
    newer_ = !findings.kept().empty() && findings.kept().front().cause == Cause::newer;
    if (survey_.header) page_.emplace(file_, survey_, true);
  }

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  [[nodiscard]] const InputFile& file() const noexcept { return file_; }
  /// Says whether the file is of a version, or has a feature, that this program does not read.
  [[nodiscard]] bool newer() const noexcept { return newer_; }
  [[nodiscard]] const Survey& survey() const noexcept { return survey_; }
  [[nodiscard]] const KnownPages& point_pages() const noexcept { return point_pages_; }
  /// Returns the intact attribute page of a group and rank; null when it is lost.
  [[nodiscard]] const PageSite* attributes(std::uint8_t group, std::uint32_t rank) const {
    const auto pages = attribute_pages_.find(group);
    if (pages == attribute_pages_.end()) return nullptr;
    const auto found = pages->second.find(rank);
    return found == pages->second.end() ? nullptr : found->second.site;
  }

  /// Reads a page.
  /// @return  its decoded payload, until the next call; empty when the page is not intact
  std::span<const std::byte> read(const PageSite& site) {
    if (page_->check(site, 3, flips_)) return {};
    return page_->payload();
  }
  /// Returns the codec of a page.
  [[nodiscard]] Codec codec(const PageSite& site) {
    static_cast<void>(page_->check(site, 1, flips_));
    return page_->header().coding.codec;
  }

  /// Reads the meta page once more, because a flipped bit in it can be turned back this time.
  /// @return  its content; empty when the page is lost
  [[nodiscard]] std::optional<Meta> find_meta() {
    for (const PageSite& site : survey_.sites) {
      if (site.entry.type != PageType::meta) continue;
      const std::span<const std::byte> payload = read(site);
      if (payload.empty()) continue;
      try {
        return decode_meta(payload, survey_.header->point_bytes);
      } catch (const FormatError&) {  // the meta page is lost
      }
    }
    return std::nullopt;
  }

  /// Finds an intact copy of every page of points and of the groups of a schema. Where several
  /// sites have one rank, the first intact one counts.
  void find_sound_pages(const Meta& meta) {
    survey_.meta = meta;
    survey_.columns = columns_by_group(meta);
    // Check all pages where they should lie.
    progress_.begin("check pages", survey_.sites.size(), "pages");
    bool lost = false;
    for (const PageSite& site : survey_.sites) {
      lost |= !consider(site);
      progress_.advance(1);
    }
    progress_.end();
    // A page that is not in its place may lie elsewhere, as after a swap of two pages.
    if (lost) find_moved_pages();
  }

 private:
  /// Searches the whole file for pages that are not in their places. What the directory says of a
  /// page, other than its place, must hold for the copy too.
  void find_moved_pages() {
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
    KnownPages* const kind = kind_of(site.entry);
    if (kind == nullptr) return true;
    Known& known = (*kind)[site.rank];
    if (known.site != nullptr) return true;
    const std::span<const std::byte> payload = read(site);
    if (payload.empty()) return false;
    known.site = &site;
    if (site.entry.type == PageType::point) {
      const PointPage points(payload.data(), site.entry.record_count, survey_.header->point_bytes);
      known.first_key = points[0].key;
      known.last_key = points[site.entry.record_count - 1].key;
    }
    return true;
  }

  /// Returns the map for pages of this kind; null for pages that a salvage does not keep.
  KnownPages* kind_of(const DirectoryEntry& entry) {
    if (entry.type == PageType::point) return &point_pages_;
    const bool wanted = entry.type == PageType::attribute && survey_.columns.contains(entry.group);
    return wanted ? &attribute_pages_[entry.group] : nullptr;
  }

  InputFile file_;
  FlipBudget& flips_;
  Progress& progress_;
  Survey survey_;
  bool newer_ = false;
  std::optional<SurveyedPage> page_;
  std::vector<PageSite> moved_;  ///< pages that a scan of the file found
  KnownPages point_pages_;
  std::map<std::uint8_t, KnownPages> attribute_pages_;  ///< by group
};

/// A point page that is kept.
struct KeptPage {
  Remains* file = nullptr;
  std::uint32_t rank = 0;
  const PageSite* site = nullptr;
};

/// Streams the points of the kept pages, page by page.
class KeptPoints : public PointStream {
 public:
  explicit KeptPoints(std::span<const KeptPage> pages) : pages_(pages) {}

  std::size_t next(std::span<PointRecord> out) override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (at_ == count_) {
        if (pages_.empty()) break;
        const KeptPage& page = pages_.front();
        payload_ = page.file->read(*page.site);
        if (payload_.empty())
          throw DataError(page.file->path().string() + ": changed while it was salvaged");
        count_ = page.site->entry.record_count;
        point_bytes_ = page.file->survey().header->point_bytes;
        at_ = 0;
        pages_ = pages_.subspan(1);
      }
      const PointPage points(payload_.data(), count_, point_bytes_);
      while (at_ < count_ && filled < out.size()) out[filled++] = points[at_++];
    }
    return filled;
  }

 private:
  std::span<const KeptPage> pages_;  ///< still to come
  std::span<const std::byte> payload_;
  std::uint8_t point_bytes_ = kPointBytes;
  std::uint32_t count_ = 0, at_ = 0;
};

/// One salvage, from the survey of the damaged file and of its parts to the finished new file.
class Salvage {
 public:
  Salvage(const std::filesystem::path& path, const SalvageOptions& options, Progress& progress)
      : options_(options),
        progress_(progress),
        flips_(options.flip_budget),
        file_(path, flips_, progress) {}

  SalvageReport run(const std::filesystem::path& target) {
    // Survey the damaged file, and the parts of a scene of parts.
    require_identity();
    if (header().has_parts()) {
      survey_parts(target);
    } else {
      sources_ = {&file_};
    }
    require_memory();
    // Choose the pages to keep.
    find_meta();
    for (Remains* source : sources_) source->find_sound_pages(meta_);
    choose_pages();
    if (kept_.empty())
      refuse("spec/recovery.md#survey", "no point page is intact, so there is nothing to salvage");
    // Write them as a new file.
    write(target);
    return report_;
  }

 private:
  [[noreturn]] void refuse(const char* rule, const std::string& text) const {
    throw FormatError(0, rule, text).rebased(0, file_.path().string());
  }
  [[nodiscard]] const FileHeader& header() const { return *file_.survey().header; }
  [[nodiscard]] const std::optional<Superblock>& before() const {
    return file_.survey().superblock;
  }

  /// Refuses a file without an identity, and one with a feature that forbids repair.
  void require_identity() const {
    if (!file_.survey().header) {
      if (file_.newer()) static_cast<void>(read_file_header(file_.file()));  // says what it needs
      refuse("spec/recovery.md#survey",
             "neither the header nor a superblock is whole, so no page can be shown to belong to "
             "this file");
    }
    at_offset(file_.file(), 0, [&] { check_copyable(header()); });
  }

  /// Surveys the parts that are named by intact records, as far as they are there.
  void survey_parts(const std::filesystem::path& target) {
    std::map<std::uint32_t, const PageSite*> pages;
    for (const PageSite& site : file_.survey().sites) {
      if (site.entry.type == PageType::parts) pages.emplace(site.rank, &site);
    }
    for (const auto& [rank, site] : pages) {
      const std::span<const std::byte> payload = file_.read(*site);
      for (std::size_t at = 0; at < payload.size(); at += kPartBytes)
        survey_part(payload.subspan(at, kPartBytes), target);
    }
    if (sources_.empty())
      refuse("spec/recovery.md#salvage",
             "no part of the scene is there, or the pages that name the parts are lost: salvage "
             "the parts one by one");
  }

  void survey_part(std::span<const std::byte> bytes, const std::filesystem::path& target) {
    PartRecord record;
    try {
      record = decode_part(bytes);
    } catch (const FormatError&) {  // this part is lost
      return;
    }
    pages_before_ += (record.points - 1) / points_per_page(header()) + 1;
    const std::filesystem::path path = file_beside(file_.path(), record.name);
    if (!is_file(path)) return;
    require_other_file(path, target);
    auto part = std::make_unique<Remains>(path, flips_, progress_);
    const std::optional<FileHeader>& found = part->survey().header;
    if (!found || found->uuid != record.uuid || found->has_parts() ||
        found->frame.origin != header().frame.origin || found->frame.edge != header().frame.edge ||
        found->page_shift != header().page_shift || found->point_bytes != header().point_bytes)
      return;
    sources_.push_back(part.get());
    parts_.push_back(std::move(part));
  }

  /// Refuses a cap that is too small.
  void require_memory() const {
    std::uint64_t pages = 0;
    for (const Remains* source : sources_)
      pages += source->survey().sites.size() + source->survey().void_pages.size();
    MemoryBudget budget(options_.memory_bytes, "the salvage of this file", "memory_bytes");
    budget.charge("the program", kProgramBytes);
    if (file_.file().is_remote()) budget.charge(RemoteFile::kMemory, RemoteFile::kMemoryBytes);
    budget.charge("the list of pages", kPageBytes * pages);
    budget.charge("open pages", kPagesOpen << header().page_shift);
    budget.charge("node pages that wait", held_pages_bytes(header().page_shift));
    budget.require();
  }

  /// Takes channels and texts from the file, or, when they are lost, from a part.
  void find_meta() {
    std::optional<Meta> found = file_.find_meta();
    for (const auto& part : parts_) {
      if (found) break;
      found = part->find_meta();
    }
    report_.meta = found.has_value();
    if (found) meta_ = std::move(*found);
  }

  /// Chooses the pages to keep: point pages whose keys do not lie before the page in front, and the
  /// attribute pages next to them.
  void choose_pages() {
    MortonKey last_key;
    for (Remains* source : sources_) {
      for (const auto& [rank, page] : source->point_pages()) {
        if (page.site == nullptr || page.first_key < last_key) continue;
        last_key = page.last_key;
        kept_.push_back({source, rank, page.site});
      }
    }
    if (!header().has_parts())
      pages_before_ = before() ? before()->point_pages : file_.point_pages().size();
    report_.point_pages_before = pages_before_;
    report_.point_pages = kept_.size();
    if (before()) report_.points_before = before()->points;
    const std::vector<std::uint8_t> groups = channel_groups(meta_.channels);
    report_.attribute_pages_before = groups.size() * pages_before_;
    for (const std::uint8_t group : groups) {
      report_.attribute_pages += static_cast<std::uint64_t>(std::ranges::count_if(
          kept_, [&](const KeptPage& page) { return attributes_of(page, group) != nullptr; }));
    }
    count_void_pages(groups);
  }

  /// Counts the void pages next to kept points as kept: no damage can reach them.
  void count_void_pages(std::span<const std::uint8_t> groups) {
    std::set<std::pair<const Remains*, std::uint32_t>> kept;
    for (const KeptPage& page : kept_) kept.emplace(page.file, page.rank);
    for (const Remains* source : sources_) {
      for (const PageSite& page : source->survey().void_pages) {
        if (std::ranges::find(groups, page.entry.group) != groups.end() &&
            kept.contains({source, page.rank}))
          ++report_.attribute_pages;
      }
    }
  }

  /// Returns the intact attribute page next to a point page; null when there is none.
  [[nodiscard]] static const PageSite* attributes_of(const KeptPage& page, std::uint8_t group) {
    const PageSite* const site = page.file->attributes(group, page.rank);
    const bool fits = site != nullptr && site->entry.record_count == page.site->entry.record_count;
    return fits ? site : nullptr;
  }

  void write(const std::filesystem::path& target) {
    // Open a file with the old frame and page size, and a uuid of its own.
    ContainerWriter writer(target, {.page_shift = header().page_shift,
                                    .codec = kept_.front().file->codec(*kept_.front().site),
                                    .uuid = new_uuid(),
                                    .frame = header().frame,
                                    .point_bytes = header().point_bytes});
    // Write the points and their octree, then the channels.
    BuildOptions tree;
    if (before()) tree.leaf_points = std::max(1U, before()->leaf_points);
    KeptPoints points(kept_);
    progress_.begin("build", kept_.size() * points_per_page(header()), "points");
    Superblock after = build_pages(points, writer, tree, ThreadPool(options_.threads), progress_);
    progress_.end();
    for (const auto& [group, columns] : columns_by_group(meta_))
      write_channels(writer, group, columns, after.points);
    // Record in the meta page what was kept, and publish the file.
    Meta meta = meta_;
    meta.text.insert_or_assign(
        "salvaged",
        fmt::format("{} of {} points, {} of {} pages of channels", after.points,
                    before() ? std::to_string(before()->points) : "an unknown number of",
                    report_.attribute_pages, report_.attribute_pages_before));
    report_.superblock = writer.finish(meta, std::move(after));
    report_.points = report_.superblock.points;
    // Report the kept shares of area and flux.
    const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 1.0; };
    const auto flux = [](const Superblock& s) { return s.flux[0] + s.flux[1] + s.flux[2]; };
    if (!before()) return;
    report_.area_share = share(report_.superblock.area, before()->area);
    report_.flux_share = share(flux(report_.superblock), flux(*before()));
  }

  /// Writes the attribute pages of one group. The kept pages are as long as the old point pages, of
  /// which some are lost, so their columns move to pages of the new length.
  /// @param points  in the new file
  void write_channels(ContainerWriter& writer, std::uint8_t group,
                      const std::vector<PackedColumn>& columns, std::uint64_t points) {
    auto next = kept_.begin();
    const auto next_page = [&](std::span<std::byte> payload) {
      const KeptPage& page = *next++;
      const std::uint32_t count = page.site->entry.record_count;
      const PageSite* const site = attributes_of(page, group);
      const std::span<const std::byte> values =
          site == nullptr ? std::span<const std::byte>() : page.file->read(*site);
      if (values.empty()) {
        const std::size_t bytes = group_point_bytes(meta_.channels, group);
        fill_void(meta_.channels, group, payload.first(bytes * count));
      } else {
        std::ranges::copy(values, payload.begin());
      }
      return count;
    };
    ChannelPager pager(columns, payload_limit(header().page_shift), next_page);
    const std::uint32_t full = points_per_page(writer.header());
    for (std::uint64_t left = points; left > 0;) {
      const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(full, left));
      writer.write_attributes(group, pager.next(count), count, meta_.channels);
      left -= count;
    }
  }

  /// Derives the uuid of the new file from the old one and the kept points. It differs from the old
  /// one, so that no page of the damaged file can pass for a page of the new one.
  Uuid new_uuid() const {
    std::vector<std::byte> text(header().uuid.begin(), header().uuid.end());
    for (const KeptPage& page : kept_) {
      text.resize(text.size() + 8);
      store(text.data(), text.size() - 8, page.site->entry.payload_xxh3);
    }
    return uuid_of(text);
  }

  SalvageOptions options_;
  Progress& progress_;
  FlipBudget flips_;
  Remains file_;
  std::vector<std::unique_ptr<Remains>> parts_;
  std::vector<Remains*> sources_;   ///< the file, or the parts that are there, along the curve
  std::uint64_t pages_before_ = 0;  ///< point pages that the file had, or its parts
  Meta meta_;
  std::vector<KeptPage> kept_;  ///< along the curve
  SalvageReport report_;
};

}  // namespace

SalvageReport salvage_container(const std::filesystem::path& path,
                                const std::filesystem::path& target, const SalvageOptions& options,
                                Progress& progress) {
  require_other_file(path, target);
  return Salvage(path, options, progress).run(target);
}

}  // namespace ptc
