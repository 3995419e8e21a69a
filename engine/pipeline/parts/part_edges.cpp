#include "engine/pipeline/parts/part_edges.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/state_file.h"
#include "engine/octree/octree.h"
#include "engine/sort/point_streams.h"
#include "engine/store/container_points.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 16;  // points that are read at once

/// Numbers the groups of a tree, and keeps none.
class NumberedGroups : public GroupSink {
 public:
  ChildRef add(const GroupView& /*group*/, std::uint64_t /*end*/) override {
    return {.interior = true, .page = next_++};
  }

 private:
  std::uint32_t next_ = 0;
};

/// Reads groups of a container.
class StoredGroups {
 public:
  explicit StoredGroups(const ContainerReader& container)
      : container_(container), payload_(container.page_payload_limit()) {}

  /// Returns a group, valid until the next call.
  [[nodiscard]] GroupView at(const ChildRef& ref) {
    if (page_ != ref.page) {
      header_ = container_.read_page(container_.node_pages()[ref.page], payload_, decoder_);
      page_ = ref.page;
    }
    return NodePage(payload_.data(), header_.record_count)[ref.slot];
  }

 private:
  const ContainerReader& container_;
  std::vector<std::byte> payload_;
  PageDecoder decoder_;
  PageHeader header_;
  std::optional<std::uint32_t> page_;
};

/// Gives the groups of a way the references that the container has.
/// @throws DataError when its tree is another one
void take_references(const ContainerReader& part, StoredGroups& stored, bool to_first,
                     std::vector<NodeGroup>& way) {
  const Superblock& s = part.superblock();
  ChildRef ref{.interior = true, .page = s.root_page, .slot = s.root_slot};
  for (auto group = way.rbegin(); group != way.rend(); ++group) {
    if (!ref.interior || ref.slot >= part.entry(part.node_pages()[ref.page]).record_count)
      throw DataError(part.path().string() + ": its tree is not that of its points");
    const GroupView view = stored.at(ref);
    if (static_cast<std::size_t>(view.size()) != group->children.size() ||
        view.level() != group->level)
      throw DataError(part.path().string() + ": its tree is not that of its points");
    for (int i = 0; i < view.size(); ++i)
      group->children[static_cast<std::size_t>(i)].ref = view.child(i);
    ref = view.child(to_first ? 0 : view.size() - 1);
  }
}

/// Checks that all groups that edges refer to are in the part.
void require_slots(const ContainerReader& part, const StateReader& state, const TreeEdges& edges) {
  const auto exists = [&](const ChildRef& ref) {
    return !ref.interior || ref.slot < part.entry(part.node_pages()[ref.page]).record_count;
  };
  bool all = exists(edges.root);
  for (const std::vector<NodeGroup>* way : {&edges.first, &edges.last}) {
    for (const NodeGroup& group : *way) {
      all = all && std::ranges::all_of(group.children,
                                       [&](const NodeChild& child) { return exists(child.ref); });
    }
  }
  state.require(all, "an edge refers to a group that the part does not have");
}

}  // namespace

std::filesystem::path edges_path(const std::filesystem::path& part) {
  std::filesystem::path path = part;
  path += ".edges";
  return path;
}

void write_edges(const std::filesystem::path& part, const TreeEdges& edges) {
  StateWriter state;
  state.put(ContainerReader(part).superblock().xxh3);
  edges.save(state);
  write_shared_state(edges_path(part), state.take());
}

void remove_part(const std::filesystem::path& part) {
  std::filesystem::remove(part);
  std::filesystem::remove(edges_path(part));
}

TreeEdges edges_of(const ContainerReader& part, const Executor& executor) {
  const std::filesystem::path path = edges_path(part.path());
  if (!std::filesystem::exists(path)) return find_edges(part, executor);
  const std::vector<std::byte> bytes = read_state(path);
  StateReader state(bytes, path.string(), kStateOffset);
  if (state.get<std::uint64_t>() != part.superblock().xxh3) return find_edges(part, executor);
  TreeEdges edges;
  edges.load(state, part.superblock().node_pages);
  state.require(edges.points == part.superblock().points, "the part has another number of points");
  state.end();
  require_slots(part, state, edges);
  return edges;
}

TreeEdges find_edges(const ContainerReader& part, const Executor& executor) {
  // Build the tree again
  NumberedGroups groups;
  OctreeBuilder octree(groups, part.superblock().leaf_points, part.header().frame.unit(), executor);
  octree.record_edges();
  ContainerPoints points(part);
  SquareSum radii;
  std::vector<PointRecord> block(kBlock);
  while (const std::size_t count = read_full(points, block)) {
    octree.add(std::span(block).first(count));
    for (const PointRecord& point : std::span(block).first(count)) radii.add(point.radius);
  }
  static_cast<void>(octree.finish());
  TreeEdges edges = octree.take_edges();
  edges.radii = radii;

  // Find where its groups lie
  StoredGroups stored(part);
  const Superblock& s = part.superblock();
  edges.root = {.interior = true, .page = s.root_page, .slot = s.root_slot};
  take_references(part, stored, true, edges.first);
  take_references(part, stored, false, edges.last);
  return edges;
}

}  // namespace ptc
