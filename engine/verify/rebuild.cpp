// Compares two trees as two sequences of groups. The builder emits groups in post-order, children
// before parents, and a walk through the stored tree visits them in the same order, so that group k
// of one belongs to group k of the other and neither tree is held in memory:
//
//   points -> OctreeBuilder -> group, group, ... -.
//                                                  equal, but for references to other groups?
//   node pages -> StoredGroups -> group, group, ..'
//
// The digest of the stored tree chains the same groups: digest = xxh3_128(digest | group).
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
constexpr std::size_t kBlock = std::size_t{1} << 15;  // points given to the builder at once

/// Returns the bytes of a group with zeros in place of the references to other groups, because the
/// writer is free to choose where groups lie.
std::vector<std::byte> content_of(const GroupView& group) {
  const auto bytes = group.bytes();
  std::vector<std::byte> content(bytes.begin(), bytes.end());
  for (unsigned i = 0; i < static_cast<unsigned>(group.size()); ++i) {
    if ((group.interior_mask() >> i & 1) != 0)
      std::memset(content.data() + kGroupHeadBytes + 8 * std::size_t{i}, 0, 8);
  }
  return content;
}

/// Returns content_of() a group of a container, with the numbers of points in one file.
std::vector<std::byte> content_of(const GroupView& group, const ContainerReader& container) {
  std::vector<std::byte> content = content_of(group);
  if (container.parts().empty()) return content;
  for (int i = 0; i < group.size(); ++i) {
    ChildRef ref = group.child(i);
    if (ref.interior) continue;
    ref.first_point = container.without_gaps(ref.first_point);
    set_reference(content, i, ref);
  }
  return content;
}

/// Reads the groups of a stored tree in post-order, children before parents.
class StoredGroups {
 public:
  StoredGroups(const ContainerReader& container, std::size_t cached_pages)
      : container_(container),
        node_pages_(container.node_pages()),
        checked_(container),
        pages_(container, checked_, cached_pages) {
    const Superblock& s = container.superblock();
    if (s.points > 0) descend(node_pages_[s.root_page], s.root_slot);
  }

  struct Group {
    std::uint32_t page = 0;
    std::uint16_t slot = 0;
    std::vector<std::byte> content;
  };
  /// Returns the next group; empty after the root.
  std::optional<Group> next() {
    if (path_.empty()) return std::nullopt;
    while (!path_.back().children.empty()) {
      const ChildRef child = path_.back().children.back();
      path_.back().children.pop_back();
      descend(node_pages_[child.page], child.slot);
    }
    Group group = std::move(path_.back().group);
    path_.pop_back();
    return group;
  }

 private:
  struct Open {
    Group group;
    std::vector<ChildRef> children;  ///< child groups not entered yet, in reverse order
  };

  void descend(std::uint32_t page, std::uint16_t slot) {
    const NodePages::Place place = pages_.page(page);
    const GroupView view = place.nodes[slot];
    Open open{.group = {page, slot, content_of(view, container_)}, .children = {}};
    for (int i = view.size(); i-- > 0;) {
      if (view.child(i).interior) open.children.push_back(view.child(i));
    }
    path_.push_back(std::move(open));
  }

  const ContainerReader& container_;
  PageNumbers::Range node_pages_;
  CheckedPages checked_;
  NodePages pages_;
  std::vector<Open> path_;
};

/// Receives the groups of the builder and compares each with the next stored group.
class Comparison : public GroupSink {
 public:
  Comparison(const ContainerReader& container, std::size_t cached_pages, Findings& findings)
      : container_(container), findings_(findings), stored_(container, cached_pages) {}

  ChildRef add(const GroupView& group, std::uint64_t) override {
    const auto stored = take();
    if (!stored || stored->content != content_of(group)) differ(stored);
    return {.interior = true};
  }

  /// Reports the first group that differs and how many do.
  /// @return  the digest of the stored tree
  std::array<std::uint64_t, 2> finish() {
    while (const auto stored = take()) differ(stored);  // groups that the builder does not have
    if (differing_ == 0) return digest_;
    findings_.add(
        {.severity =
             container_.superblock().writer == writer_name() ? Severity::damage : Severity::warning,
         .cause = Cause::writer,
         .level = 4,
         .offset = container_.entry(first_.page).offset,
         .page = first_.page,
         .rule = kRebuild,
         .text = fmt::format("page {}: group {} is not the group that the points give; groups that "
                             "differ: {}",
                             first_.page, first_.slot, differing_)});
    return digest_;
  }

 private:
  /// Returns the next stored group, and adds it to the digest.
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
      first_ = stored.value_or(
          StoredGroups::Group{.page = container_.node_pages()[container_.superblock().root_page]});
  }

  const ContainerReader& container_;
  Findings& findings_;
  StoredGroups stored_;
  std::array<std::uint64_t, 2> digest_{};
  std::uint64_t differing_ = 0;
  StoredGroups::Group first_;  ///< the first group that differs
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
