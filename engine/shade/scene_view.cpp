#include "engine/shade/scene_view.h"

#include "format/error.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {

SceneView::SceneView(const ContainerReader& container)
    : container_(&container),
      frame_(container.superblock().frame),
      points_(container.superblock().points),
      points_per_page_(container.superblock().points_per_page) {
  const Superblock& superblock = container.superblock();
  root_.interior = superblock.root_page != kNoPage;
  root_.page = superblock.root_page;
  root_.slot = superblock.root_slot;
}

GroupView SceneReader::group(std::uint32_t page, std::uint16_t slot) {
  const PageReader::Page view = pages_.get(page);
  const NodePage nodes(view.payload, view.record_count);
  if (slot >= nodes.size()) {
    throw FormatError(0, "spec/nodes.md#references", "a node refers to a group that its page does not hold");
  }
  return nodes[slot];
}

void SceneReader::widen(const GroupView& group, const glm::dvec3& origin, GroupLanes& lanes) const noexcept {
  const double unit = view_.frame().unit();
  const LatticePoint corner = decode_morton(group.cell());
  const int level = group.level();
  const double edge = level < kLatticeBits ? static_cast<double>(std::uint64_t{1} << (kLatticeBits - level)) : 1.0;
  const float step = static_cast<float>(edge * unit / 65536);
  const float radius_unit = static_cast<float>(unit);
  const float x0 = static_cast<float>((static_cast<double>(corner[0]) - origin.x) * unit);
  const float y0 = static_cast<float>((static_cast<double>(corner[1]) - origin.y) * unit);
  const float z0 = static_cast<float>((static_cast<double>(corner[2]) - origin.z) * unit);
  const std::byte* x = group.mean_x();
  const std::byte* y = group.mean_y();
  const std::byte* z = group.mean_z();
  const std::byte* radius = group.radius();
  lanes.size = group.size();
  for (int i = 0; i < lanes.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    lanes.x[k] = x0 + step * static_cast<float>(GroupView::u16_at(x, i));
    lanes.y[k] = y0 + step * static_cast<float>(GroupView::u16_at(y, i));
    lanes.z[k] = z0 + step * static_cast<float>(GroupView::u16_at(z, i));
    lanes.radius[k] = radius_unit * decode_ufloat16(GroupView::u16_at(radius, i));
  }
}

void SceneReader::surfels(std::uint64_t first, int count, const glm::dvec3& origin, SurfelLanes& lanes) {
  const double unit = view_.frame().unit();
  lanes.size = count;
  std::uint32_t page = kNoPage;
  PageReader::Page view;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t index = first + static_cast<std::uint64_t>(i);
    if (const std::uint32_t wanted = view_.point_page(index); wanted != page) {
      page = wanted;
      view = pages_.get(page);
    }
    const PointPage points(view.payload, view.record_count);
    const auto slot = static_cast<std::uint32_t>(index % view_.points_per_page());
    const LatticePoint at = points.position(slot);
    const auto k = static_cast<std::size_t>(i);
    lanes.x[k] = static_cast<float>((static_cast<double>(at[0]) - origin.x) * unit);
    lanes.y[k] = static_cast<float>((static_cast<double>(at[1]) - origin.y) * unit);
    lanes.z[k] = static_cast<float>((static_cast<double>(at[2]) - origin.z) * unit);
    lanes.radius[k] = points.radius(slot);
    const std::array<std::int16_t, 2> uv = points.normal(slot);
    const std::array<float, 3> n = decode_octahedral(uv[0], uv[1]);
    lanes.nx[k] = n[0];
    lanes.ny[k] = n[1];
    lanes.nz[k] = n[2];
    const std::array<std::uint16_t, 3> c = points.radiance(slot);
    lanes.rgbe[k] = encode_rgbe({decode_half(c[0]), decode_half(c[1]), decode_half(c[2])});
  }
}

}  // namespace ptc
