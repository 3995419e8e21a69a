// Study of the axis pages (model.h): the bytes of a scene's pages after rounding, packing and
// coding, and the CPU time to decode them.
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "engine/base/memory.h"
#include "engine/octree/rounding.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/container_points.h"
#include "format/point_page.h"
#include "tools/bench/experiments/model.h"
#include "tools/bench/references/timed_runs.h"

namespace ptc::bench {
namespace {

/// A page as it lies in memory, with the columns by which it can be packed.
struct PagePayload {
  std::vector<std::byte> bytes;
  PayloadColumns columns;
};

/// The pages of nodes.
std::vector<PagePayload> node_payloads(const ContainerReader& container) {
  std::vector<PagePayload> pages;
  std::vector<std::byte> buffer(container.page_payload_limit());
  PageDecoder decoder;
  for (const std::uint32_t page : container.node_pages()) {
    const PageHeader header = container.read_page(page, buffer, decoder);
    pages.push_back({{buffer.begin(), buffer.begin() + header.raw_bytes}, {}});
  }
  return pages;
}

/// The pages of points.
struct PointPayloads {
  std::vector<PagePayload> pages;
  double moved = 0;  ///< maximum of moved() over all points
};

/// The distance between two positions of a point, in its radii.
double moved(const PointRecord& from, const PointRecord& to, const Frame& frame) {
  if (to.radius <= 0) return 0;
  const std::array<double, 3> a = frame.to_position(decode_morton(from.key)),
                              b = frame.to_position(decode_morton(to.key));
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / static_cast<double>(to.radius);
}

/// Encodes the points, rounded or as they are, page by page.
PointPayloads point_payloads(const ContainerReader& container, bool rounded) {
  const Frame& frame = container.header().frame;
  const std::uint8_t point_bytes = container.header().point_bytes;
  ContainerPoints originals(container), points(container);
  const ThreadPool executor(1);
  const std::unique_ptr<PointStream> rounding =
      rounded ? round_points(points, frame.unit(), executor) : nullptr;
  PointPayloads out;
  std::vector<PointRecord> from(points_per_page(container.header())), to(from.size());
  while (const std::size_t count =
             originals.next(from)) {  // both streams return one page at a time
    const std::size_t same = rounding ? rounding->next(to) : points.next(to);
    if (same != count) throw std::logic_error("point_payloads: streams differ");
    for (std::size_t i = 0; i < count; ++i)
      out.moved = std::max(out.moved, moved(from[i], to[i], frame));
    out.pages.push_back({encode_point_page(std::span(to).first(count), point_bytes),
                         {static_cast<std::uint32_t>(count), packed_point_columns(point_bytes)}});
  }
  return out;
}

/// Encodes pages, and measures the time to decode them.
class PageStudy {
 public:
  PageStudy(const BenchScene& scene, unsigned repeats) : scene_(scene), repeats_(repeats) {}

  /// Measures one codec and level on pages of one form.
  /// @param form  points, packed, rounded or nodes
  [[nodiscard]] ModelRow measure(const std::vector<PagePayload>& pages, const std::string& form,
                                 Codec codec, int level) const {
    const bool nodes = form == "nodes";
    PageEncoder encoder(codec, level);
    std::vector<Stored> stored(pages.size());
    double bytes = 0;
    for (std::size_t i = 0; i < pages.size(); ++i) {
      const PayloadColumns columns = form == "points" ? PayloadColumns{} : pages[i].columns;
      stored[i].coding = encoder.encode(pages[i].bytes, stored[i].bytes, columns);
      bytes += static_cast<double>(stored[i].bytes.size());
    }
    Costs costs;
    for (unsigned repeat = 0; repeat < repeats_; ++repeat)
      costs.add(timed([&] { decode(pages, stored); }));
    const Superblock& superblock = scene_.container().superblock();
    const auto records = static_cast<double>(nodes ? superblock.nodes : superblock.points);
    return {.scene = scene_.name(),
            .axis = "pages",
            .variant = codec == Codec::zstd  ? fmt::format("zstd {}", level)
                       : codec == Codec::lz4 ? "lz4"
                                             : "raw",
            .form = form,
            .bytes = bytes / records,
            .per = nodes ? "node" : "point",
            .decode_ns = 1e9 * spread_of(costs.cpu).median / records};
  }

 private:
  struct Stored {
    Coding coding;
    std::vector<std::byte> bytes;
  };

  void decode(const std::vector<PagePayload>& pages, const std::vector<Stored>& stored) const {
    PageDecoder decoder;
    std::vector<std::byte> payload(scene_.container().page_payload_limit());
    for (std::size_t i = 0; i < pages.size(); ++i) {
      decoder.decode(stored[i].coding, stored[i].bytes,
                     std::span(payload).first(pages[i].bytes.size()), pages[i].columns);
    }
  }

  const BenchScene& scene_;
  unsigned repeats_;
};

}  // namespace

std::vector<ModelRow> study_pages(const BenchScene& scene, const ModelOptions& options) {
  const PageStudy study(scene, options.repeats);
  std::vector<ModelRow> rows;
  const auto add = [&](const std::vector<PagePayload>& pages, const std::string& form) {
    const std::size_t first = rows.size();
    if (form == "points" || form == "nodes")
      rows.push_back(study.measure(pages, form, Codec::raw, 0));
    rows.push_back(study.measure(pages, form, Codec::lz4, 0));
    for (const int level : options.levels)
      rows.push_back(study.measure(pages, form, Codec::zstd, level));
    return std::span(rows).subspan(first);
  };
  const PointPayloads exact = point_payloads(scene.container(), false),
                      rounded = point_payloads(scene.container(), true);
  for (ModelRow& row : add(exact.pages, "points")) row.moved = exact.moved;
  for (ModelRow& row : add(exact.pages, "packed")) row.moved = exact.moved;
  for (ModelRow& row : add(rounded.pages, "rounded")) row.moved = rounded.moved;
  add(node_payloads(scene.container()), "nodes");
  return rows;
}

}  // namespace ptc::bench
