#include "engine/trace/decoded_tree.h"

#include <algorithm>
#include <utility>

#include "engine/trace/decode_kernels.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

// Places of the tables, which a core's own cache holds: more are hardly faster
// (spec/notes/rays.md)
constexpr std::size_t kGroupPlaces = 1024, kLeafPlaces = 1024;
static_assert(kGroupPlaces * (sizeof(TraceGroup) + 8) + kLeafPlaces * (sizeof(TraceLeaf) + 8) <=
              DecodedTree::kBytes);

}  // namespace

DecodedTree::DecodedTree(const SceneView& view, PageCache& cache, float backs, float rim)
    : scene_(view, cache),
      rules_{.lengths = view.scale().length_factors(), .clear_backs = backs, .rim = rim},
      groups_(kGroupPlaces),
      leaves_(kLeafPlaces) {}

glm::dvec3 DecodedTree::place(const glm::dvec3& position) const {
  const Frame& frame = view().frame();
  const glm::dvec3 low(frame.origin[0], frame.origin[1], frame.origin[2]);
  glm::dvec3 at;
  for (int k = 0; k < 3; ++k) {
    at[k] = std::clamp(view().scale().length(position[k] - low[k]), -SceneScale::kMaxDistance,
                       SceneScale::kMaxDistance) /
            SceneScale::kLatticeUnit;
  }
  return at;
}

void DecodedTree::decode_group(std::uint64_t reference, TraceGroup& into) {
  const ChildRef ref = decode_reference(reference, true);
  if (ref.page != view().root().page && scene_.is_lost(view().node_page(ref.page))) {
    into = {};
    return;
  }
  const PinnedGroup found = scene_.group(ref.page, ref.slot);
  decode_boxes(*found, rules_, into);
}

void DecodedTree::decode_leaf(std::uint64_t first, std::uint32_t count, TraceLeaf& into) {
  // Append the points of each page that holds some of the run.
  const std::uint32_t per_page = view().points_per_page();
  into.size = count;
  bool anchored = false;
  for (std::uint32_t done = 0; done < count;) {
    const auto at = static_cast<std::uint32_t>((first + done) % per_page);
    const std::uint32_t number = std::min(count - done, per_page - at);
    if (scene_.is_lost(view().point_page(first + done))) {
      for (std::uint32_t i = done; i < done + number; ++i)
        into.discs[i / kTraceLanes].radius2[i % kTraceLanes] = -1;
      done += number;
      continue;
    }
    const PageGuard page = scene_.points(first + done);
    if (!std::exchange(anchored, true)) {
      const PointPage points(page.payload(), page.record_count(), view().point_bytes());
      const LatticePoint anchor = points.position(at);
      for (int k = 0; k < 3; ++k)
        into.anchor[k] = static_cast<double>(anchor[static_cast<std::size_t>(k)]);
    }
    decode_discs(page.payload(), page.record_count(), at, number, done, rules_, into);
    done += number;
  }
}

glm::vec3 DecodedTree::outgoing(std::uint64_t point, bool emission) {
  const PageGuard page = scene_.points(point);
  const PointPage points(page.payload(), page.record_count(), view().point_bytes());
  const auto at = static_cast<std::uint32_t>(point % view().points_per_page());
  const Half3 reflected = points.radiance(at), emitted = emission ? points.emission(at) : Half3{};
  glm::vec3 sum;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    sum[k] = decode_half(reflected[i]) + decode_half(emitted[i]);
  }
  return sum;
}

}  // namespace ptc
