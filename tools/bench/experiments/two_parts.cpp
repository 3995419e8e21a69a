// The root group of the whole is copied; its children are cut between the parts:
//
//   whole     root | child 0 | child 1 | child 2 | child 3 |      the scene's only group
//   part 0    root | child 0 | child 1 |
//   part 1                       root  | child 0 | child 1 |
#include "tools/bench/experiments/two_parts.h"

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/error.h"
#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "format/node_page.h"
#include "format/parts_page.h"

namespace ptc::bench {
namespace {

/// A group and the payload of its page, which it is a view of.
struct LoadedGroup {
  LoadedGroup(const ContainerReader& container, const ChildRef& at)
      : payload(container.page_payload_limit()) {
    PageDecoder decoder;
    const PageHeader header =
        container.read_page(container.node_pages()[at.page], payload, decoder);
    page.emplace(payload.data(), header.record_count);
    group.emplace((*page)[at.slot]);
  }
  std::vector<std::byte> payload;
  std::optional<NodePage> page;
  std::optional<GroupView> group;
};

LoadedGroup root_of(const ContainerReader& container) {
  const Superblock& s = container.superblock();
  return {container, {.interior = true, .page = s.root_page, .slot = s.root_slot}};
}

/// Returns the number of the first point below a child.
std::uint64_t first_point(const ContainerReader& container, ChildRef ref) {
  while (ref.interior) ref = LoadedGroup(container, ref).group->child(0);
  return ref.first_point;
}

/// The next points of a stream up to a number of them.
class SomePoints : public PointStream {
 public:
  SomePoints(PointStream& points, std::uint64_t count) : points_(points), left_(count) {}
  std::size_t next(std::span<PointRecord> out) override {
    if (left_ == 0) return 0;
    const std::size_t count = points_.next(out.first(std::min<std::uint64_t>(left_, out.size())));
    if (count > 0 && !any_) first_ = out[0].key;
    if (count > 0) last_ = out[count - 1].key;
    any_ = any_ || count > 0;
    left_ -= count;
    return count;
  }
  [[nodiscard]] MortonKey first() const noexcept { return first_; }
  [[nodiscard]] MortonKey last() const noexcept { return last_; }

 private:
  PointStream& points_;
  std::uint64_t left_;
  bool any_ = false;
  MortonKey first_{}, last_{};
};

WriterOptions options_of(const ContainerReader& whole, std::uint8_t number) {
  Uuid uuid = whole.header().uuid;
  uuid[0] ^= std::byte{number};
  return {.page_shift = whole.header().page_shift,
          .uuid = uuid,
          .frame = whole.header().frame,
          .point_bytes = whole.header().point_bytes};
}

/// Writes a part. @return its record, but for the sums over the parts before it
PartRecord write_part(const ContainerReader& whole, std::uint8_t number, SomePoints points,
                      const std::filesystem::path& target) {
  Progress silent;
  ContainerWriter writer(target, options_of(whole, number));
  const Superblock built = build_pages(
      points, writer, {.leaf_points = whole.superblock().leaf_points}, ThreadPool(1), silent);
  writer.finish({}, built);
  const ContainerReader part(target);
  const Superblock& s = part.superblock();
  return {.uuid = s.header.uuid,
          .superblock_xxh3 = s.xxh3,
          .file_bytes = s.file_bytes,
          .points = s.points,
          .node_pages = s.node_pages,
          .first_key = points.first(),
          .last_key = points.last(),
          .name = target.filename().string()};
}

}  // namespace

void write_two_parts(const ContainerReader& whole, const std::filesystem::path& scene,
                     const std::array<std::filesystem::path, 2>& parts) {
  // Cut the points before a child of the root
  LoadedGroup root = root_of(whole);
  const int half = root.group->size() / 2;
  const std::uint64_t cut = first_point(whole, root.group->child(half));
  ContainerPoints points(whole);
  const std::uint64_t all = whole.superblock().points;
  std::array<PartRecord, 2> records{write_part(whole, 1, SomePoints(points, cut), parts[0]),
                                    write_part(whole, 2, SomePoints(points, all - cut), parts[1])};
  records[0].first_node_page = 1;  // behind the page of the top
  records[1].first_point = records[0].points;
  records[1].first_node_page = 1 + records[0].node_pages;

  // Let the children of the root lead to the groups of the parts
  Superblock superblock = whole.superblock();
  superblock.writer.clear();
  superblock.nodes = static_cast<std::uint64_t>(root.group->size());
  superblock.node_groups = 1;
  for (std::size_t p = 0, begin = 0; p < 2; ++p) {
    const ContainerReader part(parts[p]);
    const LoadedGroup own = root_of(part);
    const int size = own.group->size();
    if (own.group->level() != root.group->level() ||
        size != (p == 0 ? half : root.group->size() - half))
      throw DataError(whole.path().string() + ": the tree cannot be cut at its root");
    for (int i = 0; i < size; ++i) {
      ChildRef ref = own.group->child(i);
      if (!ref.interior) continue;  // the run of a leaf has the same numbers in the whole
      ref.page += records[p].first_node_page;
      const auto at = static_cast<std::size_t>(root.group->bytes().data() - root.payload.data());
      set_reference(std::span(root.payload).subspan(at), static_cast<int>(begin) + i, ref);
    }
    begin += static_cast<std::size_t>(size);
    superblock.nodes += part.superblock().nodes;
    superblock.node_groups += part.superblock().node_groups;
  }

  // Write the top and the list of the parts
  WriterOptions options = options_of(whole, 0);
  options.parts = true;
  ContainerWriter writer(scene, options);
  NodePageEncoder encoder(whole.page_payload_limit());
  superblock.root_slot = encoder.add(*root.group);
  superblock.root_page = writer.reserve_page(PageType::node);
  writer.keep_page({.type = PageType::node,
                    .rank = superblock.root_page,
                    .level = static_cast<std::uint8_t>(root.group->level()),
                    .record_count = 1,
                    .first_key = root.group->cell().high,
                    .last_key = root.group->cell().high},
                   encoder.take());
  std::vector<std::byte> list;
  for (const PartRecord& record : records) append_part(record, list);
  writer.keep_page({.type = PageType::parts,
                    .rank = writer.reserve_page(PageType::parts),
                    .record_count = 2,
                    .first_key = records[0].first_key.high,
                    .last_key = records[1].last_key.high},
                   list);
  writer.finish(whole.meta(), superblock);
}

}  // namespace ptc::bench
