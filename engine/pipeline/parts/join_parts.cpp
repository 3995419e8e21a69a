#include "engine/pipeline/parts/join_parts.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/octree/scene_top.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "format/parts_page.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr std::uint32_t kMaxPages = std::numeric_limits<std::uint32_t>::max();

/// Returns the name of a part as the scene records it.
std::string name_of(const std::filesystem::path& part, const std::filesystem::path& folder) {
  const std::filesystem::path name = std::filesystem::proximate(part, folder);
  const std::string text = name.generic_string();
  if (name.is_absolute() || text.starts_with("..") || !is_utf8(text) || text.size() > 255) {
    throw RequestError("inputs", part.string() +
                                     ": a part lies in the folder of the scene or below it, under "
                                     "a name of at most 255 bytes of UTF-8");
  }
  return text;
}

/// Returns how a part differs from the first one; empty when they go together.
std::string difference(const ContainerReader& part, const FileHeader& header,
                       std::uint32_t leaf_points, const Meta& meta) {
  const FileHeader& own = part.header();
  if (own.has_parts()) return "it is a scene of parts itself";
  if (part.superblock().points == 0) return "it has no points";
  if (own.frame.origin != header.frame.origin || own.frame.edge != header.frame.edge)
    return "it has another frame";
  if (own.page_shift != header.page_shift) return "it has another page size";
  if (own.point_bytes != header.point_bytes) return "its points have other bytes";
  if (part.superblock().leaf_points != leaf_points) return "it has leaves of another size";
  if (part.meta().channels != meta.channels) return "it has other channels";
  return {};
}

/// The parts of a scene, read one after another.
class Join {
 public:
  Join(const std::filesystem::path& target, const RunOptions& run, Progress& progress)
      : target_(target), executor_(run.threads), progress_(progress) {}

  Superblock run(std::span<const std::filesystem::path> parts) {
    for (const std::filesystem::path& part : parts) add(part);
    const SceneTop::Result top = top_->finish(payload_limit(header_.page_shift));
    for (const std::string& key : differing_)
      progress_.note("the parts record different texts `" + key + "`: the scene has none");
    number_parts(static_cast<std::uint32_t>(top.pages.size()));
    complete(top);
    return write(top);
  }

 private:
  /// Takes what the scene says of a part.
  void add(const std::filesystem::path& path) {
    // Open it and see that it goes with the others
    const ContainerReader part(path, ContainerReader::OpenParts::no);
    const Superblock& s = part.superblock();
    if (!top_) begin(part);
    if (const std::string what = difference(part, header_, scene_.leaf_points, meta_);
        !what.empty()) {
      throw DataError(path.string() + ": " + what + ": it is no part of this scene");
    }
    TreeEdges edges = edges_of(part, executor_);

    // Note it, and add up what all have
    records_.push_back({.uuid = part.header().uuid,
                        .superblock_xxh3 = s.xxh3,
                        .file_bytes = s.file_bytes,
                        .first_point = scene_.points,
                        .points = s.points,
                        .node_pages = s.node_pages,
                        .first_key = edges.first_leaf.front().key,
                        .last_key = edges.last_leaf.back().key,
                        .name = name_of(path, directory_of(target_))});
    const bool first = scene_.points == 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto both = [&](double a, double b, auto least) { return first ? b : least(a, b); };
      scene_.bounds_low[k] = both(scene_.bounds_low[k], s.bounds_low[k], std::ranges::min);
      scene_.bounds_high[k] = both(scene_.bounds_high[k], s.bounds_high[k], std::ranges::max);
      scene_.flux[k] += s.flux[k];
    }
    if (s.points > kMaxTreePoints - scene_.points)
      throw DataError(path.string() + ": with it, the scene has 2^48 points or more");
    scene_.points += s.points;
    scene_.nodes += s.nodes;
    scene_.node_groups += s.node_groups;
    scene_.levels = std::max(scene_.levels, s.levels);
    radii_.add(edges.radii);
    take_texts(part.meta().text);
    top_->add(std::move(edges), path.string(), s.node_pages);
  }

  void begin(const ContainerReader& part) {
    header_ = part.header();
    meta_ = part.meta();
    scene_.leaf_points = part.superblock().leaf_points;
    top_.emplace(scene_.leaf_points, header_.frame.unit());
  }

  /// Leaves out the texts that a part does not have, or has otherwise.
  void take_texts(const std::map<std::string, std::string>& texts) {
    std::erase_if(meta_.text, [&](const auto& text) {
      const auto same = texts.find(text.first);
      if (same != texts.end() && same->second == text.second) return false;
      differing_.insert(text.first);
      return true;
    });
    for (const auto& [key, value] : texts) {
      if (!meta_.text.contains(key)) differing_.insert(key);
    }
  }

  /// @param node_pages  of the scene's own file
  void number_parts(std::uint32_t node_pages) {
    for (PartRecord& record : records_) {
      if (record.node_pages > kMaxPages - node_pages)
        throw DataError(record.name + ": with it, the scene has more pages than a reference names");
      record.first_node_page = node_pages;
      node_pages += record.node_pages;
    }
  }

  void complete(const SceneTop::Result& top) {
    scene_.root_page = top.root.page;
    scene_.root_slot = top.root.slot;
    scene_.nodes += top.nodes;
    scene_.node_groups += top.groups;
    scene_.levels = std::max(scene_.levels, static_cast<std::uint16_t>(top.levels));
    scene_.area = 2 * radii_.value();
  }

  /// Returns the parts pages.
  [[nodiscard]] std::vector<ContainerWriter::Page> parts_pages() const {
    const std::size_t full = payload_limit(header_.page_shift) / kPartBytes;
    std::vector<ContainerWriter::Page> pages;
    for (std::size_t at = 0; at < records_.size(); at += full) {
      const auto some = std::span(records_).subspan(at, std::min(full, records_.size() - at));
      ContainerWriter::Page& page = pages.emplace_back();
      page.summary = {.type = PageType::parts,
                      .record_count = static_cast<std::uint32_t>(some.size()),
                      .first_key = some.front().first_key.high,
                      .last_key = some.back().last_key.high};
      for (const PartRecord& record : some) append_part(record, page.payload);
    }
    return pages;
  }

  Superblock write(const SceneTop::Result& top) {
    std::vector<ContainerWriter::Page> pages = top.pages;
    std::ranges::move(parts_pages(), std::back_inserter(pages));
    std::vector<std::byte> records;
    for (const PartRecord& record : records_) append_part(record, records);
    ContainerWriter writer(target_, {.page_shift = header_.page_shift,
                                     .uuid = uuid_of(records),
                                     .frame = header_.frame,
                                     .point_bytes = header_.point_bytes,
                                     .parts = true});
    for (std::size_t i = 0; i < pages.size(); ++i) {
      PageSummary& summary = pages[i].summary;
      summary.rank = writer.reserve_page(summary.type);
      if (pages.size() - i < kMaxTailPages) {
        writer.keep_page(summary, pages[i].payload);
      } else {
        writer.write_page(summary, pages[i].payload);
      }
    }
    return writer.finish(meta_, scene_);
  }

  const std::filesystem::path& target_;
  const ThreadPool executor_;
  Progress& progress_;
  FileHeader header_;  ///< of the first part
  Meta meta_;          ///< its channels, and the texts of all parts
  std::set<std::string> differing_;
  Superblock scene_;
  SquareSum radii_;
  std::vector<PartRecord> records_;
  std::optional<SceneTop> top_;
};

}  // namespace

Superblock join_parts(std::span<const std::filesystem::path> parts,
                      const std::filesystem::path& target, const RunOptions& run,
                      Progress& progress) {
  require_request(!parts.empty(), "inputs", "a scene of parts has at least one part");
  return Join(target, run, progress).run(parts);
}

}  // namespace ptc
