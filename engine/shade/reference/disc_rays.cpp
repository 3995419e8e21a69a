// Embree rays at oriented discs, with the rule by which overlapping discs divide.
//
// A disc counts at the depth of a shallow paraboloid, t + kBump e^2 / r, with e the distance of the
// hit from the disc's centre and r its radius (spec/shading.md#surfels). Embree knows flat discs
// only, so each ray is traced twice:
//
//     1. Find the nearest flat disc, at t. No paraboloid is deeper than kBump r below its disc, so
//        whatever wins lies between t and t + kBump r of that disc.
//     2. Trace that short stretch again. A filter looks at every disc there, notes the one of least
//        bumped depth, and rejects each.
//
// The filter also lets rays through backs that are clear. All lengths are in edges of the scene's
// frame, as in the gather.
#include <limits>
#include <stdexcept>

#include <glm/geometric.hpp>

#include "engine/base/embree.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/scene_scale.h"

namespace ptc {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();

}  // namespace

struct DiscRays::Impl {
  /// The frame of the numbers that Embree is given, which must stay below 1.8e18.
  struct Space {
    glm::dvec3 origin{0};       ///< scene units; rays are exact relative to it
    SceneScale scale{Frame{}};  ///< unit of length
  };

  /// One ray's state, which Embree hands to the filter.
  struct Context {
    RTCIntersectContext embree;  ///< first, because Embree hands back a pointer to it
    const Impl* discs;
    bool choose = false;  ///< second pass: note the disc of least bumped depth
    float best = 0;       ///< that depth
    unsigned best_disc = RTC_INVALID_GEOMETRY_ID;
  };

  std::span<const Surfel> surfels;
  Sides sides;
  std::function<glm::vec3(const glm::vec3&)> sky;
  Space space;
  Owned<RTCDevice, rtcReleaseDevice> device{rtcNewDevice(nullptr)};
  Owned<RTCScene, rtcReleaseScene> scene{device == nullptr ? nullptr : rtcNewScene(device)};

  /// Returns the centre of a disc relative to the origin, in edges of the frame.
  [[nodiscard]] glm::vec3 centre(unsigned i) const {
    return space.scale.way(space.origin, surfels[i].position);
  }
  [[nodiscard]] float radius(unsigned i) const { return space.scale.radius(surfels[i].radius); }

  /// Decides about one disc that a ray meets: whether the disc stops the ray and, in the second
  /// pass, whether it is the one of least bumped depth.
  static void filter(const RTCFilterFunctionNArguments* args) {
    // Reject backs that are clear.
    if (args->valid[0] != -1) return;
    const auto& ray = *reinterpret_cast<const RTCRay*>(args->ray);
    const auto& hit = *reinterpret_cast<const RTCHit*>(args->hit);
    auto& context = *reinterpret_cast<Context*>(args->context);
    const Surfel& disc = context.discs->surfels[hit.primID];
    const float radius = context.discs->radius(hit.primID);
    const glm::vec3 from(ray.org_x, ray.org_y, ray.org_z), along(ray.dir_x, ray.dir_y, ray.dir_z);
    const glm::vec3 to = context.discs->centre(hit.primID) - from;
    const bool back = glm::dot(to, disc.normal) >= 0;
    if (back && (context.discs->sides == Sides::front || glm::dot(to, to) < 4 * radius * radius)) {
      args->valid[0] = 0;
      return;
    }
    // Note the disc if it is the best so far, and reject it, so that Embree goes on to the next.
    if (!context.choose) return;
    const glm::vec3 off = along * ray.tfar - to;
    const float depth = ray.tfar + kBump / radius * glm::dot(off, off);
    if (depth < context.best) {
      context.best = depth;
      context.best_disc = hit.primID;
    }
    args->valid[0] = 0;
  }

  [[nodiscard]] static RTCRayHit make_ray(const glm::vec3& from, const glm::vec3& along, float near,
                                          float far) {
    RTCRayHit ray{};
    ray.ray.org_x = from.x;
    ray.ray.org_y = from.y;
    ray.ray.org_z = from.z;
    ray.ray.dir_x = along.x;
    ray.ray.dir_y = along.y;
    ray.ray.dir_z = along.z;
    ray.ray.tnear = near;
    ray.ray.tfar = far;
    ray.ray.mask = ~0U;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    return ray;
  }

  /// Returns what a ray meets.
  [[nodiscard]] DiscHit meet(const glm::vec3& from, const glm::vec3& along) const {
    // Find the nearest flat disc.
    Context context{};
    rtcInitIntersectContext(&context.embree);
    context.discs = this;
    RTCRayHit ray = make_ray(from, along, 0, kNever);
    rtcIntersect1(scene, &context.embree, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    // Find the least bumped depth among the discs just behind it.
    const float t = ray.ray.tfar;
    const float slack = 1e-6F * t;
    const float deepest = t + kBump * radius(ray.hit.primID) + slack;
    context.choose = true;
    context.best = kNever;
    RTCRayHit again = make_ray(from, along, t - slack, deepest);
    rtcIntersect1(scene, &context.embree, &again);
    // Take the nearest disc at its deepest where rounding has left the second pass without any.
    if (context.best_disc == RTC_INVALID_GEOMETRY_ID) {
      context.best = deepest;
      context.best_disc = ray.hit.primID;
    }
    const Surfel& disc = surfels[context.best_disc];
    return {context.best, glm::dot(along, disc.normal) < 0 ? disc.outgoing() : glm::vec3(0)};
  }
};

DiscRays::DiscRays(std::span<const Surfel> surfels, Sides sides,
                   std::function<glm::vec3(const glm::vec3&)> sky)
    : impl_(std::make_unique<Impl>()) {
  // Choose the frame.
  impl_->surfels = surfels;
  impl_->sides = sides;
  impl_->sky = std::move(sky);
  Bounds bounds;
  for (const Surfel& s : surfels) bounds.add(s.position);
  if (!bounds.empty()) {
    const glm::dvec3 &low = bounds.low, &high = bounds.high;
    impl_->space = {(low + high) * 0.5,
                    SceneScale(frame_around({low.x, low.y, low.z}, {high.x, high.y, high.z}))};
  }
  // Make the buffers: four floats of a disc's centre and radius, three of its normal.
  check_device(impl_->device);
  const Owned<RTCGeometry, rtcReleaseGeometry> geometry(
      rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT));
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, surfels.size()));
  auto* normals = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_NORMAL, 0, RTC_FORMAT_FLOAT3, 12, surfels.size()));
  check_device(impl_->device);
  // Fill them, and build the tree.
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const glm::vec3 c = impl_->centre(static_cast<unsigned>(i));
    for (int k = 0; k < 3; ++k) {
      vertices[4 * i + static_cast<std::size_t>(k)] = c[k];
      normals[3 * i + static_cast<std::size_t>(k)] = surfels[i].normal[k];
    }
    vertices[4 * i + 3] = impl_->radius(static_cast<unsigned>(i));
  }
  rtcSetGeometryIntersectFilterFunction(geometry, &Impl::filter);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcCommitScene(impl_->scene);
  check_device(impl_->device);
}

DiscRays::~DiscRays() = default;

Shading DiscRays::trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const {
  std::vector<glm::vec3> directions;
  cosine_directions(receiver.normal, rays, seed, directions);
  std::vector<DiscHit> hits(directions.size());
  meet(receiver.position, directions, hits);
  return sum_rays(receiver, directions, hits, impl_->sky);
}

void DiscRays::meet(const glm::dvec3& position, std::span<const glm::vec3> directions,
                    std::span<DiscHit> hits) const {
  const glm::vec3 from = impl_->space.scale.way(impl_->space.origin, position);
  for (std::size_t i = 0; i < hits.size(); ++i) hits[i] = impl_->meet(from, directions[i]);
}

}  // namespace ptc
