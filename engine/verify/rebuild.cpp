// Two trees side by side: groups leave the builder in the order in which a walk of the stored tree
// leaves them.
#include "engine/verify/rebuild.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "engine/octree/octree.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "engine/verify/node_pages.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr char kRebuild[] = "spec/nodes.md#tree-digest";
constexpr std::size_t kBlock = std::size_t{1} << 15;  // points at once

/// A group's bytes with 0 where a child is another group: where that lies is the writer's choice.
std::vector<std::byte> content_of(const GroupView& group) {
  const auto bytes = group.bytes();
  std::vector<std::byte> content(bytes.begin(), bytes.end());
  for (unsigned i = 0; i < static_cast<unsigned>(group.size()); ++i) {
    if ((group.interior_mask() >> i & 1) != 0)
      std::memset(content.data() + kGroupHeadBytes + 8 * std::size_t{i}, 0, 8);
  }
  return content;
}

/// The groups of a stored tree, children before parents.
class StoredGroups {
 public:
  StoredGroups(const ContainerReader& container, std::size_t cached_pages)
      : pages_(container, cached_pages) {
    const Superblock& s = container.superblock();
    if (s.points > 0) descend(s.root_page, s.root_slot);
  }

  struct Group {
    std::uint32_t page = 0;
    std::uint16_t slot = 0;
    std::vector<std::byte> content;
  };
  std::optional<Group> next() {
    if (path_.empty()) return std::nullopt;
    while (!path_.back().children.empty()) {
      const ChildRef child = path_.back().children.back();
      path_.back().children.pop_back();
      descend(child.page, child.slot);
    }
    Group group = std::move(path_.back().group);
    path_.pop_back();
    return group;
  }

 private:
  struct Open {
    Group group;
    std::vector<ChildRef> children;  ///< groups that were not entered yet, the last first
  };

  void descend(std::uint32_t page, std::uint16_t slot) {
    const NodePages::Place place = pages_.page(page);
    const GroupView view = place.nodes[slot];
    Open open{.group = {page, slot, content_of(view)}, .children = {}};
    for (int i = view.size(); i-- > 0;) {
      if (view.child(i).interior) open.children.push_back(view.child(i));
    }
    path_.push_back(std::move(open));
  }

  NodePages pages_;
  std::vector<Open> path_;
};

/// Compares what the builder emits with what is stored.
class Comparison : public GroupSink {
 public:
  Comparison(const ContainerReader& container, std::size_t cached_pages, Findings& findings)
      : container_(container), findings_(findings), stored_(container, cached_pages) {}

  ChildRef add(const GroupView& group, std::uint64_t) override {
    const auto stored = take();
    if (!stored || stored->content != content_of(group)) differ(stored);
    return {.interior = true};
  }

  std::array<std::uint64_t, 2> finish() {
    while (const auto stored = take()) differ(stored);  // the builder has no such groups
    if (differing_ == 0) return digest_;
    findings_.add({.severity = container_.superblock().writer == writer_name() ? Severity::damage
                                                                               : Severity::warning,
                   .cause = Cause::writer,
                   .level = 4,
                   .offset = container_.entry(first_.page).offset,
                   .page = first_.page,
                   .rule = kRebuild,
                   .text = fmt::format(
                       "page {}: group {} is not what its points give; {} groups in all are not",
                       first_.page, first_.slot, differing_)});
    return digest_;
  }

 private:
  std::optional<StoredGroups::Group> take() {
    auto group = stored_.next();
    if (!group) return group;
    std::vector<std::byte> chained(sizeof digest_);
    std::memcpy(chained.data(), digest_.data(), sizeof digest_);
    chained.insert(chained.end(), group->content.begin(), group->content.end());
    digest_ = xxh3_128(chained);
    return group;
  }

  void differ(const std::optional<StoredGroups::Group>& stored) {
    if (differing_++ == 0)
      first_ = stored.value_or(StoredGroups::Group{.page = container_.superblock().root_page});
  }

  const ContainerReader& container_;
  Findings& findings_;
  StoredGroups stored_;
  std::array<std::uint64_t, 2> digest_{};
  std::uint64_t differing_ = 0;
  StoredGroups::Group first_;  ///< of these
};

}  // namespace

std::array<std::uint64_t, 2> compare_rebuilt(const ContainerReader& container,
                                             std::size_t cached_pages, Findings& findings,
                                             const Executor& executor, Progress& progress) {
  const Superblock& s = container.superblock();
  Comparison comparison(container, cached_pages, findings);
  OctreeBuilder builder(comparison, std::max(1U, s.leaf_points), s.header.frame.unit(), executor);
  ContainerPoints points(container);
  std::vector<PointRecord> block(kBlock);
  while (const std::size_t count = points.next(block)) {
    builder.add(std::span(block).first(count));
    progress.advance(count);
  }
  static_cast<void>(builder.finish());
  return comparison.finish();
}

}  // namespace ptc
