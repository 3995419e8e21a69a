// Each part is built from its points alone. A cell whose points lie in one part has the same group
// there as in the whole scene; the groups of all other cells make up the top.
#include "tests/support/parts.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "format/node_page.h"
#include "format/parts_page.h"
#include "tests/support/scenes.h"

namespace ptc::test {
namespace {

/// All groups of a container, in memory.
class Groups {
 public:
  explicit Groups(const ContainerReader& container) {
    PageDecoder decoder;
    for (const std::uint32_t page : container.node_pages()) {
      auto& payload = payloads_.emplace_back(container.page_payload_limit());
      counts_.push_back(container.read_page(page, payload, decoder).record_count);
    }
  }
  [[nodiscard]] GroupView operator[](const ChildRef& ref) const {
    return NodePage(payloads_[ref.page].data(), counts_[ref.page])[ref.slot];
  }
  /// Calls visit(group, reference) for every group.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (std::uint32_t page = 0; page < counts_.size(); ++page) {
      for (std::uint32_t slot = 0; slot < counts_[page]; ++slot) {
        const ChildRef ref{true, page, static_cast<std::uint16_t>(slot), 0, 0};
        visit((*this)[ref], ref);
      }
    }
  }
  /// Returns the number of the first point below a child.
  [[nodiscard]] std::uint64_t first_point(ChildRef ref) const {
    while (ref.interior) ref = (*this)[ref].child(0);
    return ref.first_point;
  }
  /// Returns the number after that of the last point below a child.
  [[nodiscard]] std::uint64_t end_point(ChildRef ref) const {
    while (ref.interior) ref = (*this)[ref].child((*this)[ref].size() - 1);
    return ref.first_point + ref.point_count;
  }

 private:
  std::vector<std::vector<std::byte>> payloads_;
  std::vector<std::uint32_t> counts_;
};

/// Cuts a container and writes the parts and the scene.
class Cutter {
 public:
  Cutter(const ContainerReader& whole, unsigned count, const std::filesystem::path& target)
      : whole_(whole), groups_(whole), target_(target), encoder_(whole.page_payload_limit()) {
    // Cut before leaves, so that no leaf has points of two parts.
    std::vector<std::uint64_t> leaves;
    groups_.for_each([&](const GroupView& group, const ChildRef&) {
      for (int i = 0; i < group.size(); ++i) {
        if (const ChildRef ref = group.child(i); !ref.interior) leaves.push_back(ref.first_point);
      }
    });
    std::ranges::sort(leaves);
    for (unsigned i = 0; i < count; ++i) cuts_.push_back(leaves[i * leaves.size() / count]);
    cuts_.push_back(whole.superblock().points);
  }

  void run() {
    write_parts();
    write_scene();
  }

 private:
  /// The groups of a part by their cells: a cell has one group.
  using Cell = std::tuple<std::uint64_t, std::uint64_t, int>;
  using Places = std::map<Cell, ChildRef>;

  static Cell cell_of(const GroupView& group) {
    return {group.cell().high, group.cell().low, group.level()};
  }

  void write_parts() {
    std::vector<PointRecord> all(static_cast<std::size_t>(whole_.superblock().points));
    ContainerPoints points(whole_);
    if (points.next(all) != all.size()) throw std::logic_error("write_parts: points are missing");
    std::filesystem::create_directories(target_.parent_path() / "parts");
    std::uint64_t before = 0;
    for (std::size_t i = 0; i + 1 < cuts_.size(); ++i) {
      const std::string name = "parts/" + std::to_string(i) + ".ptcx";
      const std::filesystem::path path = target_.parent_path() / name;
      const std::vector<PointRecord> own(all.begin() + static_cast<std::ptrdiff_t>(cuts_[i]),
                                         all.begin() + static_cast<std::ptrdiff_t>(cuts_[i + 1]));
      write_part(path, own, static_cast<std::byte>(i + 1));
      const ContainerReader part(path);
      const Superblock& s = part.superblock();
      records_.push_back({.uuid = s.header.uuid,
                          .superblock_xxh3 = s.xxh3,
                          .file_bytes = s.file_bytes,
                          .first_point = before,
                          .points = s.points,
                          .node_pages = s.node_pages,
                          .first_key = own.front().key,
                          .last_key = own.back().key,
                          .name = name});
      before += s.points;
      nodes_ += s.nodes;
      node_groups_ += s.node_groups;
      Groups(part).for_each([&](const GroupView& group, const ChildRef& ref) {
        places_[i].emplace(cell_of(group), ref);
      });
    }
  }

  void write_part(const std::filesystem::path& path, const std::vector<PointRecord>& points,
                  std::byte name) const {
    Progress silent;
    ContainerWriter writer(path, options(name));
    VectorStream stream(points);
    const Superblock superblock = build_pages(
        stream, writer, {.leaf_points = whole_.superblock().leaf_points}, ThreadPool(1), silent);
    writer.finish({}, superblock);
  }

  [[nodiscard]] WriterOptions options(std::byte name) const {
    return {.page_shift = whole_.header().page_shift,
            .codec = Codec::zstd,
            .uuid = Uuid{std::byte{0x50}, name},
            .frame = whole_.header().frame,
            .point_bytes = whole_.header().point_bytes};
  }

  /// Adds the groups of the top below a child, deepest first, and returns the reference to it.
  /// Ranks of node pages of parts count from the part's first one: the number of the part is in
  /// `first_point`.
  ChildRef place(const ChildRef& ref) {
    if (!ref.interior) return ref;
    const std::uint64_t first = groups_.first_point(ref), end = groups_.end_point(ref);
    const auto behind = std::ranges::upper_bound(cuts_, first);
    if (end <= *behind) {
      const auto part = static_cast<std::size_t>(behind - cuts_.begin() - 1);
      ChildRef found = places_[part].at(cell_of(groups_[ref]));
      found.page += kPart * static_cast<std::uint32_t>(part + 1);
      return found;
    }
    const GroupView group = groups_[ref];
    std::vector<ChildRef> children;
    for (int i = 0; i < group.size(); ++i) children.push_back(place(group.child(i)));
    if (!encoder_.fits(children.size(), group.emits())) end_page();
    nodes_ += children.size();
    ++node_groups_;
    level_ = std::min(level_, group.level());
    keys_.push_back(group.cell().high);
    std::vector<std::byte> copy(group.bytes().begin(), group.bytes().end());
    for (int i = 0; i < group.size(); ++i)
      set_reference(copy, i, children[static_cast<std::size_t>(i)]);
    return {true, static_cast<std::uint32_t>(pages_.size()), encoder_.add(GroupView(copy.data())),
            0, 0};
  }

  void end_page() {
    const auto [low, high] = std::ranges::minmax(keys_);
    ContainerWriter::Page page{.summary = {.type = PageType::node,
                                           .level = static_cast<std::uint8_t>(level_),
                                           .record_count = encoder_.size(),
                                           .first_key = low,
                                           .last_key = high},
                               .payload = encoder_.take()};
    pages_.push_back(std::move(page));
    level_ = 63;
    keys_.clear();
  }

  void write_scene() {
    Superblock superblock = whole_.superblock();
    superblock.writer.clear();
    const ChildRef root = place({true, superblock.root_page, superblock.root_slot, 0, 0});
    end_page();
    superblock.root_page = root.page;
    superblock.root_slot = root.slot;
    superblock.nodes = nodes_;
    superblock.node_groups = node_groups_;
    number_parts();

    WriterOptions scene = options(std::byte{0});
    scene.parts = true;
    ContainerWriter writer(target_, scene);
    for (ContainerWriter::Page& page : pages_) {
      page.summary.rank = writer.reserve_page(PageType::node);
      writer.keep_page(page.summary, page.payload);
    }
    std::vector<std::byte> payload;
    const std::size_t full = whole_.page_payload_limit() / kPartBytes;
    for (std::size_t i = 0; i < records_.size(); ++i) {
      append_part(records_[i], payload);
      if ((i + 1) % full != 0 && i + 1 < records_.size()) continue;
      const std::size_t count = payload.size() / kPartBytes;
      writer.keep_page({.type = PageType::parts,
                        .rank = writer.reserve_page(PageType::parts),
                        .record_count = static_cast<std::uint32_t>(count),
                        .first_key = records_[i + 1 - count].first_key.high,
                        .last_key = records_[i].last_key.high},
                       payload);
      payload.clear();
    }
    writer.finish(whole_.meta(), superblock);
  }

  /// Gives the node pages of the parts their ranks in the scene, now that the top's are counted.
  void number_parts() {
    auto next = static_cast<std::uint32_t>(pages_.size());
    for (PartRecord& record : records_) {
      record.first_node_page = next;
      next += record.node_pages;
    }
    for (ContainerWriter::Page& page : pages_) {
      const NodePage nodes(page.payload.data(), page.summary.record_count);
      for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
        const GroupView group = nodes[slot];
        const auto at = static_cast<std::size_t>(group.bytes().data() - page.payload.data());
        for (int i = 0; i < group.size(); ++i) {
          ChildRef ref = group.child(i);
          if (!ref.interior || ref.page < kPart) continue;
          ref.page = ref.page % kPart + records_[ref.page / kPart - 1].first_node_page;
          set_reference(std::span(page.payload).subspan(at), i, ref);
        }
      }
    }
  }

  static constexpr std::uint32_t kPart = 0x100000;  ///< more than a part has node pages

  const ContainerReader& whole_;
  Groups groups_;
  std::filesystem::path target_;
  std::vector<std::uint64_t> cuts_;  ///< first point of each part, and the end
  std::vector<PartRecord> records_;
  std::map<std::size_t, Places> places_;
  NodePageEncoder encoder_;
  std::vector<ContainerWriter::Page> pages_;  ///< of the top
  int level_ = 63;
  std::vector<std::uint64_t> keys_;
  std::uint64_t nodes_ = 0, node_groups_ = 0;
};

}  // namespace

void write_parts(const ContainerReader& whole, unsigned count,
                 const std::filesystem::path& target) {
  Cutter(whole, count, target).run();
}

}  // namespace ptc::test
