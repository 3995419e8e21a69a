#include "engine/build/build.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "engine/build/octree.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

/// Fills node pages, one open page per stream of levels. A page gets its number when it is opened,
/// so that parents can refer to groups that are not on the disk yet.
class NodePageStreams : public GroupSink {
 public:
  NodePageStreams(ContainerWriter& writer, int levels_per_stream)
      : writer_(writer),
        levels_per_stream_(levels_per_stream),
        payload_limit_((std::size_t{1} << writer.header().page_shift) - kPageHeaderBytes) {}

  ChildRef add(const NodeGroup& group) override {
    const int key = group.level / levels_per_stream_;
    auto found = streams_.find(key);
    if (found != streams_.end() && !found->second.encoder.fits(group.children.size())) {
      flush(found->second);
      streams_.erase(found);
      found = streams_.end();
    }
    if (found == streams_.end()) {
      found = streams_.emplace(key, Stream{writer_.reserve_page(), NodePageEncoder(payload_limit_)}).first;
    }
    Stream& stream = found->second;
    stream.keys.include(group);
    return {.interior = true, .page = stream.page, .slot = stream.encoder.add(group)};
  }

  /// Writes the pages still open, deepest first: the coarse levels end up last in the file.
  void finish() {
    for (auto stream = streams_.rbegin(); stream != streams_.rend(); ++stream) flush(stream->second);
    streams_.clear();
  }

 private:
  struct Range {
    std::uint64_t first = ~std::uint64_t{0};
    std::uint64_t last = 0;
    std::uint16_t least_level = 0xffff;
    void include(const NodeGroup& group) {
      first = std::min(first, group.cell.high);
      last = std::max(last, group.cell.high);
      least_level = std::min(least_level, static_cast<std::uint16_t>(group.level));
    }
  };
  struct Stream {
    std::uint32_t page;
    NodePageEncoder encoder;
    Range keys{};
  };

  void flush(Stream& stream) {
    const std::uint32_t groups = stream.encoder.size();
    writer_.write_page(stream.page,
                       {.type = PageType::node,
                        .level = stream.keys.least_level,
                        .record_count = groups,
                        .first_key = stream.keys.first,
                        .last_key = stream.keys.last},
                       stream.encoder.take());
  }

  ContainerWriter& writer_;
  int levels_per_stream_;
  std::size_t payload_limit_;
  std::map<int, Stream> streams_;
};

void write_point_page(ContainerWriter& writer, std::span<const PointRecord> points) {
  writer.write_page(writer.reserve_page(),
                    {.type = PageType::point,
                     .record_count = static_cast<std::uint32_t>(points.size()),
                     .first_key = points.front().key.high,
                     .last_key = points.back().key.high},
                    encode_point_page(points));
}

void include(Superblock& superblock, const Frame& frame, std::span<const PointRecord> points, bool first) {
  for (const PointRecord& point : points) {
    const std::array<double, 3> at = frame.to_position(decode_morton(point.key));
    for (std::size_t k = 0; k < 3; ++k) {
      superblock.bounds_low[k] = first ? at[k] : std::min(superblock.bounds_low[k], at[k]);
      superblock.bounds_high[k] = first ? at[k] : std::max(superblock.bounds_high[k], at[k]);
    }
    first = false;
    const double area = 2.0 * static_cast<double>(point.radius) * static_cast<double>(point.radius);
    superblock.area += area;
    for (std::size_t c = 0; c < 3; ++c) {
      superblock.flux[c] += area * static_cast<double>(decode_half(point.radiance[c]));
    }
  }
}

/// Fills `block` whole unless the stream ends.
std::size_t read_full(PointStream& points, std::span<PointRecord> block) {
  std::size_t filled = 0;
  while (filled < block.size()) {
    const std::size_t count = points.next(block.subspan(filled));
    if (count == 0) break;
    filled += count;
  }
  return filled;
}

}  // namespace

Superblock build_pages(PointStream& points, ContainerWriter& writer,
                       const BuildOptions& options, Progress& progress) {
  const Frame& frame = writer.header().frame;
  Superblock superblock;
  superblock.leaf_points = options.leaf_points;
  superblock.points_per_page = points_per_page(writer.header());

  NodePageStreams nodes(writer, options.levels_per_stream);
  OctreeBuilder octree(nodes, options.leaf_points, frame.unit());
  std::vector<PointRecord> block(superblock.points_per_page);
  while (const std::size_t count = read_full(points, block)) {
    const std::span<const PointRecord> page = std::span(block).first(count);
    include(superblock, frame, page, superblock.points == 0);
    superblock.points += count;
    write_point_page(writer, page);
    for (const PointRecord& point : page) octree.add(point);
    progress.advance(count);
  }
  const OctreeBuilder::Result tree = octree.finish();
  nodes.finish();

  superblock.nodes = tree.nodes;
  superblock.node_groups = tree.groups;
  superblock.levels = static_cast<std::uint16_t>(tree.levels);
  if (tree.root.interior) {
    superblock.root_page = tree.root.page;
    superblock.root_slot = tree.root.slot;
  }
  return superblock;
}

}  // namespace ptc
