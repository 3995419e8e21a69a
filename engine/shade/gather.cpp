#include "engine/shade/gather.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/shade/receiver_cell.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr float kPi = 3.14159265F;

/// What a cell shares is drawn as its centre sees it, what it leaves to its children as they do. The
/// two pictures of one surface part by up to the cell's radius, so a seam this many radii wide
/// belongs to both; without it light leaks between them (spec/shading.md#seams).
constexpr float kSeam = 3;

/// Work left for the children of a receiver cell: some children of a group, or some surfels.
struct Entry {
  std::uint64_t first = 0;  // surfels: index of the first
  std::uint32_t page = 0;   // group
  std::uint16_t slot = 0;
  std::uint8_t mask = 0;    // which of up to 8
  bool surfels = false;
};

constexpr std::uint8_t kAll = 0xff;  // a group may have fewer than 8: its size limits the mask

/// True when the surfels of a cluster face one way so nearly that one large surfel stands for them.
/// @param normal  mean over area
bool is_flat(const glm::vec3& normal) { return glm::dot(normal, normal) > 0.81F; }

/// A cluster as one receiver sees it.
struct SeenCluster {
  float area = 0;          // of its surfels, scene units squared
  glm::vec3 normal{0};     // mean over area, not unit: 1 where all face one way
  float projected = 0;     // area seen, over area
  std::uint32_t rgbe = 0;  // of the front
};

/// @param toward  unit, from the cluster to the receiver
SeenCluster look_at(const GroupView& group, int child, const glm::vec3& toward, Sides sides) {
  float weight[6];
  const std::byte* facing = group.facing(child);
  for (int k = 0; k < 6; ++k) weight[k] = static_cast<float>(GroupView::u16_at(facing, k)) * (1.0F / 65535);
  SeenCluster seen{.area = decode_ufloat16(GroupView::u16_at(group.area(), child)),
                   .normal = {weight[0] - weight[1], weight[2] - weight[3], weight[4] - weight[5]}};
  // Vector area: the part that faces one way; what is left faces every way alike.
  const float along = glm::dot(seen.normal, toward);
  const float scattered = std::max(0.0F, 1 - std::sqrt(glm::dot(seen.normal, seen.normal))) * 0.25F;
  const float front = std::max(0.0F, along) + scattered;
  seen.projected = sides == Sides::both ? std::abs(along) + scattered : front;
  if (!(seen.projected > 0)) return seen;

  glm::vec3 light(0);
  float sum = 0;
  const std::byte* radiance = group.radiance(child);
  for (int axis = 0; axis < 3; ++axis) {
    const int k = 2 * axis + (toward[axis] < 0 ? 1 : 0);
    const float w = std::abs(toward[axis]) * weight[k];
    std::uint32_t rgbe;
    std::memcpy(&rgbe, radiance + 4 * k, 4);
    const std::array<float, 3> c = decode_rgbe(rgbe);
    light += w * glm::vec3(c[0], c[1], c[2]);
    sum += w;
  }
  if (sum > 0) light /= sum;
  if (!is_flat(seen.normal)) light *= front / seen.projected;  // the rest is black backs
  seen.rgbe = encode_rgbe({light.r, light.g, light.b});
  return seen;
}

}  // namespace

struct Gather::Impl {
  SceneReader scene;
  const DirectionGrid& grid;
  GatherOptions options;
  GatherCounts counts;
  std::vector<PlacedReceiver> receivers;
  std::span<Shading> results;
  std::vector<std::unique_ptr<DirectionBuffer>> buffers;  // one per depth of receiver cells
  std::vector<std::vector<Entry>> lists;                  // likewise
  std::vector<Entry> stack;
  DirectionBuffer leaf;

  Impl(const SceneView& view, PageCache& cache, const DirectionGrid& g, const GatherOptions& o)
      : scene(view, cache), grid(g), options(o), leaf(g) {}

  void place(std::span<const Receiver> from) {
    const Frame& frame = scene.view().frame();
    const double scale = 1 / frame.unit();
    const glm::dvec3 origin(frame.origin[0], frame.origin[1], frame.origin[2]);
    receivers.clear();
    for (std::size_t i = 0; i < from.size(); ++i) {
      const glm::dvec3& p = from[i].position;
      receivers.push_back({.key = encode_morton(frame.to_lattice({p.x, p.y, p.z})),
                           .position = (p - origin) * scale,
                           .normal = from[i].normal,
                           .index = i});
    }
    std::ranges::sort(receivers, [](const PlacedReceiver& a, const PlacedReceiver& b) {
      return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
  }

  void run() {
    const ChildRef& root = scene.view().root();
    std::vector<Entry> all;
    if (root.interior) {
      all.push_back({.page = root.page, .slot = root.slot, .mask = kAll});
    }
    leaf.clear();
    shade_cell(receivers, all, leaf, 0);
  }

  /// @param inherited  what the cells around this one have drawn; may be the leaf buffer at depth 0
  void shade_cell(std::span<const PlacedReceiver> cell, const std::vector<Entry>& list,
                  const DirectionBuffer& inherited, std::size_t depth) {
    const ReceiverCell bounds(cell, scene.view().frame().unit());
    if (cell.size() == 1) {
      if (&inherited != &leaf) leaf.copy(inherited);
      collect(list, bounds, leaf, nullptr);
      results[cell[0].index] = leaf.resolve(cell[0].normal);
      ++counts.receivers;
      return;
    }
    ++counts.cells;
    if (depth == buffers.size()) {
      buffers.push_back(std::make_unique<DirectionBuffer>(grid));
      lists.emplace_back();
    }
    DirectionBuffer& buffer = *buffers[depth];
    buffer.copy(inherited);
    std::vector<Entry> left = std::move(lists[depth]);  // `lists` may grow below
    left.clear();
    collect(list, bounds, buffer, &left);
    split(cell, [&](std::span<const PlacedReceiver> child) { shade_cell(child, left, buffer, depth + 1); });
    lists[depth] = std::move(left);
  }

  /// The occupied children of the smallest octree cell that holds the receivers; coincident
  /// receivers one by one.
  template <class Body>
  void split(std::span<const PlacedReceiver> cell, const Body& body) {
    const int level = common_level(cell.front().key, cell.back().key);
    for (std::size_t begin = 0; begin < cell.size();) {
      std::size_t end = begin + 1;
      if (level < kLatticeBits) {
        const int child = octant(cell[begin].key, level + 1);
        while (end < cell.size() && octant(cell[end].key, level + 1) == child) ++end;
      }
      body(cell.subspan(begin, end - begin));
      begin = end;
    }
  }

  /// Draws what is settled for all receivers of the cell; the rest goes to `left`, for its
  /// children. Without `left` (one receiver) everything is settled.
  void collect(const std::vector<Entry>& list, const ReceiverCell& cell, DirectionBuffer& buffer,
               std::vector<Entry>* left) {
    stack.assign(list.begin(), list.end());
    while (!stack.empty()) {
      const Entry entry = stack.back();
      stack.pop_back();
      if (entry.surfels) {
        collect_surfels(entry, cell, buffer, left);
      } else {
        collect_group(entry, cell, buffer, left);
      }
    }
  }

  void collect_group(const Entry& entry, const ReceiverCell& cell, DirectionBuffer& buffer,
                     std::vector<Entry>* left) {
    ++counts.groups;
    const GroupView group = scene.group(entry.page, entry.slot);
    GroupLanes lanes;
    scene.widen(group, cell.centre, lanes);
    const float limit = options.solid_angle / kPi;  // of r^2 / d^2
    const float shared_from = left ? cell.radius / options.parallax : 0;
    const float seam = kSeam * cell.radius;
    unsigned keep = 0;
    const unsigned all = (1U << group.size()) - 1;
    for (unsigned rest = entry.mask & all; rest != 0; rest &= rest - 1) {
      const int i = std::countr_zero(rest);
      const auto k = static_cast<std::size_t>(i);
      const glm::vec3 to(lanes.x[k], lanes.y[k], lanes.z[k]);
      const float r = lanes.radius[k];
      const float d2 = glm::dot(to, to);
      if (cell.has_horizon && cell.below_horizon(to, d2, r)) continue;
      if (options.sides == Sides::front && faces_away(group, i, to, d2, r + cell.radius)) continue;
      const float d = std::sqrt(d2);
      const float nearest = std::max(0.0F, d - cell.radius);
      if (r * r < limit * nearest * nearest) {  // small enough for every receiver
        if (d >= shared_from) draw_cluster(group, i, to, d, buffer);
        if (d < shared_from + seam) keep |= 1U << i;
        continue;
      }
      // Open now what the children would open anyway, or what opens into shared parts.
      const float farthest = d + cell.radius;
      if (!left || d - r >= shared_from || r * r >= limit * farthest * farthest) {
        open(group.child(i));
      } else {
        keep |= 1U << i;
      }
    }
    if (keep != 0) {
      left->push_back({.page = entry.page, .slot = entry.slot, .mask = static_cast<std::uint8_t>(keep)});
    }
  }

  /// True when every surfel of a cluster shows its back to every receiver.
  static bool faces_away(const GroupView& group, int i, const glm::vec3& to, float d2, float reach) {
    const float cosine = static_cast<float>(static_cast<std::int16_t>(GroupView::u16_at(group.cone_cos(), i))) *
                         (1.0F / 32767);
    if (cosine <= 0.05F || d2 <= reach * reach) return false;
    const std::array<float, 3> n = decode_octahedral8(GroupView::u16_at(group.cone_axis(), i));
    const float along = n[0] * to.x + n[1] * to.y + n[2] * to.z;
    const float sine = std::sqrt(std::max(0.0F, 1 - cosine * cosine)) + 0.02F;  // axis is rounded
    return along > sine * std::sqrt(d2 - reach * reach) + reach;
  }

  void open(const ChildRef& child) {
    if (child.interior) {
      stack.push_back({.page = child.page, .slot = child.slot, .mask = kAll});
      return;
    }
    for (std::uint32_t begin = 0; begin < child.point_count; begin += 8) {
      const std::uint32_t size = std::min<std::uint32_t>(8, child.point_count - begin);
      stack.push_back({.first = child.first_point + begin,
                       .mask = static_cast<std::uint8_t>((1U << size) - 1),
                       .surfels = true});
    }
  }

  /// A flat cluster is drawn as a disc of its area and normal, which keeps surfaces tight at grazing
  /// angles; any other as a square of its projected area.
  void draw_cluster(const GroupView& group, int i, const glm::vec3& to, float d, DirectionBuffer& buffer) {
    const SeenCluster seen = look_at(group, i, to * (-1 / d), options.sides);
    if (!(seen.area > 0 && seen.projected > 0)) return;
    if (is_flat(seen.normal)) {
      buffer.draw_disc(to, glm::normalize(seen.normal), std::sqrt(seen.area * 0.5F), seen.rgbe, options.sides);
    } else {
      buffer.draw_footprint(to, seen.area * seen.projected * options.inflation, seen.rgbe);
    }
    ++counts.clusters;
  }

  void collect_surfels(const Entry& entry, const ReceiverCell& cell, DirectionBuffer& buffer,
                       std::vector<Entry>* left) {
    ++counts.surfel_blocks;
    SurfelLanes lanes;
    scene.surfels(entry.first, static_cast<int>(std::bit_width(unsigned{entry.mask})), cell.centre, lanes);
    const float shared_from = left ? cell.radius / options.parallax : 0;
    const float seam = kSeam * cell.radius;
    unsigned keep = 0;
    for (unsigned rest = entry.mask; rest != 0; rest &= rest - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(rest));
      const glm::vec3 to(lanes.x[k], lanes.y[k], lanes.z[k]);
      const float r = lanes.radius[k];
      const float d2 = glm::dot(to, to);
      if (cell.has_horizon && cell.below_horizon(to, d2, r)) continue;
      const glm::vec3 normal(lanes.nx[k], lanes.ny[k], lanes.nz[k]);
      if (options.sides == Sides::front && glm::dot(to, normal) >= cell.radius) continue;
      const float d = std::sqrt(d2);
      if (d < shared_from + seam) keep |= 1U << k;
      if (d < shared_from) continue;
      if (r > 0) buffer.draw_disc(to, normal, r, lanes.rgbe[k], options.sides);
      ++counts.surfels;
    }
    if (keep != 0) {
      left->push_back({.first = entry.first, .mask = static_cast<std::uint8_t>(keep), .surfels = true});
    }
  }
};

Gather::Gather(const SceneView& view, PageCache& cache, const DirectionGrid& grid, const GatherOptions& options)
    : impl_(std::make_unique<Impl>(view, cache, grid, options)) {}
Gather::~Gather() = default;

void Gather::shade(std::span<const Receiver> receivers, std::span<Shading> results) {
  if (receivers.empty()) return;
  impl_->place(receivers);
  impl_->results = results;
  impl_->run();
}

const GatherCounts& Gather::counts() const noexcept { return impl_->counts; }

void GatherCounts::add(const GatherCounts& other) noexcept {
  receivers += other.receivers;
  cells += other.cells;
  groups += other.groups;
  surfel_blocks += other.surfel_blocks;
  clusters += other.clusters;
  surfels += other.surfels;
}

}  // namespace ptc
