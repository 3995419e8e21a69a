// Occlusion is the share of cosine-distributed rays that hit something, irradiance is pi times the
// mean radiance that they find:
//
//      .   |   .        n rays: Sobol points of the unit square, scrambled by the receiver's seed
//        . | .          (Owen) and mapped to the hemisphere, so that each ray has the same weight
//   ------ o ------     o is the receiver
//
// Embree traverses 16 rays at once with profit where they point alike. The samples are therefore
// taken in the Z-order of the square, and each 16 successive ones make a packet.
#include "tools/bench/references/ray_baseline.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <new>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include <embree3/rtcore.h>
#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/directions.h"
#include "tools/bench/references/lightmap.h"

namespace ptc::bench {
namespace {

constexpr unsigned kPacket = 16;

/// The numbers of n Sobol points along the Z-curve of the square, an order in which neighbours
/// point in similar directions. Owen's scramble keeps points that share a box of the square
/// together, so one order serves all seeds.
std::vector<std::uint32_t> coherent_order(unsigned n) {
  // Take the points of a fixed seed: the order is as good for any other scramble
  const SquarePoints points(0);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> keys(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    const glm::vec2 p = points.square(i);
    std::uint32_t key = 0;
    for (unsigned bit = 0; bit < 16; ++bit) {
      const auto digit = [&](float x) {
        return static_cast<std::uint32_t>(x * 65536.0F) >> bit & 1U;
      };
      key |= digit(p.x) << (2 * bit) | digit(p.y) << (2 * bit + 1);
    }
    keys[i] = {key, i};
  }
  std::ranges::sort(keys);
  std::vector<std::uint32_t> order(n);
  std::ranges::transform(keys, order.begin(), [](const auto& k) { return k.second; });
  return order;
}

}  // namespace

struct RayBaseline::Impl {
  std::span<const Surfel> discs;
  Sides sides = Sides::both;
  std::optional<Lightmap> lightmap;
  glm::dvec3 origin{0};
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::array<std::vector<std::uint32_t>, 17> orders;  ///< [i]: coherent_order() of 2^i rays

  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }

  /// Discards hits of a disc's back by rays that begin within two radii of its centre, and of all
  /// backs where only fronts block light (spec/shading.md#sides).
  static void pass_near_backs(const RTCFilterFunctionNArguments* args) {
    const auto& impl = *static_cast<const Impl*>(args->geometryUserPtr);
    for (unsigned i = 0; i < args->N; ++i) {
      if (args->valid[i] != -1) continue;
      const Surfel& disc = impl.discs[RTCHitN_primID(args->hit, args->N, i)];
      const glm::vec3 from(RTCRayN_org_x(args->ray, args->N, i),
                           RTCRayN_org_y(args->ray, args->N, i),
                           RTCRayN_org_z(args->ray, args->N, i));
      const glm::vec3 to = glm::vec3(disc.position - impl.origin) - from;
      const bool back = glm::dot(to, disc.normal) >= 0;
      const bool clear =
          impl.sides == Sides::front || glm::dot(to, to) < 4 * disc.radius * disc.radius;
      if (back && clear) args->valid[i] = 0;
    }
  }

  /// Opens the device and an empty scene.
  void begin() {
    device = rtcNewDevice(nullptr);
    if (!device) throw std::runtime_error("Embree: no device");
    scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    for (std::size_t i = 4; i < orders.size(); ++i) orders[i] = coherent_order(1U << i);
  }

  /// Puts the only geometry into the scene, and builds Embree's tree.
  void finish(RTCGeometry geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw std::bad_alloc();
  }

  /// Radiance that leaves a hit towards the origin of the ray.
  [[nodiscard]] glm::vec3 radiance(unsigned primitive, float u, float v, const glm::vec3& normal,
                                   const glm::vec3& along) const {
    if (glm::dot(normal, along) >= 0) return glm::vec3(0);
    return lightmap ? lightmap->at(primitive, u, v) : discs[primitive].radiance;
  }
};

namespace {

/// A buffer of the geometry, which owns it. @throws std::bad_alloc
template <class T>
T* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t bytes,
              std::size_t count) {
  auto* buffer = static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, bytes, count));
  if (count > 0 && !buffer) throw std::bad_alloc();
  return buffer;
}

}  // namespace

RayBaseline::RayBaseline(std::span<const Surfel> discs, Sides sides)
    : impl_(std::make_unique<Impl>()) {
  // Put the origin in the middle, so that floats serve best
  impl_->discs = discs;
  impl_->sides = sides;
  impl_->begin();
  Bounds bounds;
  for (const Surfel& s : discs) bounds.add(s.position);
  if (!bounds.empty()) impl_->origin = (bounds.low + bounds.high) * 0.5;
  // Fill Embree's buffers: centre and radius, normal
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
  auto* vertices =
      new_buffer<float>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, 16, discs.size());
  auto* normals =
      new_buffer<float>(geometry, RTC_BUFFER_TYPE_NORMAL, RTC_FORMAT_FLOAT3, 12, discs.size());
  for (std::size_t i = 0; i < discs.size(); ++i) {
    const glm::vec3 c(discs[i].position - impl_->origin);
    for (int k = 0; k < 3; ++k) {
      vertices[4 * i + static_cast<std::size_t>(k)] = c[k];
      normals[3 * i + static_cast<std::size_t>(k)] = discs[i].normal[k];
    }
    vertices[4 * i + 3] = discs[i].radius;
  }
  // Let the filter decide on backs
  rtcSetGeometryUserData(geometry, impl_.get());
  rtcSetGeometryIntersectFilterFunction(geometry, &Impl::pass_near_backs);
  rtcSetGeometryOccludedFilterFunction(geometry, &Impl::pass_near_backs);
  impl_->finish(geometry);
}

RayBaseline::RayBaseline(const Mesh& mesh, std::span<const Surfel> radiance, double spacing)
    : impl_(std::make_unique<Impl>()) {
  impl_->lightmap.emplace(mesh, radiance, spacing);
  impl_->origin = mesh.origin;
  impl_->begin();
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = new_buffer<float>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, 12,
                                     mesh.positions.size());
  auto* corners = new_buffer<unsigned>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, 12,
                                       mesh.triangles.size());
  for (const glm::vec3& p : mesh.positions) {
    for (int k = 0; k < 3; ++k) *vertices++ = p[k];
  }
  for (const auto& triangle : mesh.triangles) corners = std::ranges::copy(triangle, corners).out;
  impl_->finish(geometry);
}

RayBaseline::~RayBaseline() = default;

namespace {

/// What the rays of one receiver found together.
struct Sums {
  unsigned covered = 0;  ///< rays that hit something
  glm::vec3 light{0};    ///< sum of the radiance at the hits
};

/// Sets ray i of a packet, whose fields are arrays, or the only ray.
template <class Ray>
void set_ray(Ray& ray, unsigned i, const glm::vec3& from, const glm::vec3& along) {
  const auto put = [i](auto& field, auto value) {
    if constexpr (std::is_array_v<std::remove_reference_t<decltype(field)>>) {
      field[i] = value;
    } else {
      field = value;
    }
  };
  put(ray.org_x, from.x);
  put(ray.org_y, from.y);
  put(ray.org_z, from.z);
  put(ray.dir_x, along.x);
  put(ray.dir_y, along.y);
  put(ray.dir_z, along.z);
  put(ray.tnear, 0.0F);
  put(ray.tfar, std::numeric_limits<float>::infinity());
  put(ray.time, 0.0F);
  put(ray.mask, ~0U);
  put(ray.flags, 0U);
}

using Directions = std::span<const glm::vec3>;

/// Counts the directions that something blocks, one ray at a time.
Sums occlude_single(RTCScene scene, const glm::vec3& from, Directions directions) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  Sums sums;
  for (const glm::vec3& along : directions) {
    RTCRay ray;
    set_ray(ray, 0, from, along);
    rtcOccluded1(scene, &context, &ray);
    sums.covered += ray.tfar < 0 ? 1 : 0;
  }
  return sums;
}

constexpr std::array<int, kPacket> kAllValid{-1, -1, -1, -1, -1, -1, -1, -1,
                                             -1, -1, -1, -1, -1, -1, -1, -1};

RTCIntersectContext coherent_context() {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}

/// Counts the directions that something blocks, 16 rays at a time.
Sums occlude_packets(RTCScene scene, const glm::vec3& from, Directions directions) {
  RTCIntersectContext context = coherent_context();
  alignas(64) const std::array<int, kPacket> valid = kAllValid;
  Sums sums;
  for (std::size_t first = 0; first < directions.size(); first += kPacket) {
    RTCRay16 ray;
    for (unsigned i = 0; i < kPacket; ++i) set_ray(ray, i, from, directions[first + i]);
    rtcOccluded16(valid.data(), scene, &context, &ray);
    for (const float far : ray.tfar) sums.covered += far < 0 ? 1 : 0;
  }
  return sums;
}

/// Counts hits and adds up the light that `light(primitive, u, v, normal, along)` gives for them.
template <class Light>
Sums intersect_single(RTCScene scene, const glm::vec3& from, Directions directions,
                      const Light& light) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  Sums sums;
  for (const glm::vec3& along : directions) {
    RTCRayHit ray;
    set_ray(ray.ray, 0, from, along);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    ++sums.covered;
    sums.light += light(ray.hit.primID, ray.hit.u, ray.hit.v,
                        {ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z}, along);
  }
  return sums;
}

/// Does the work of intersect_single() with 16 rays at a time.
template <class Light>
Sums intersect_packets(RTCScene scene, const glm::vec3& from, Directions directions,
                       const Light& light) {
  RTCIntersectContext context = coherent_context();
  alignas(64) const std::array<int, kPacket> valid = kAllValid;
  Sums sums;
  for (std::size_t first = 0; first < directions.size(); first += kPacket) {
    RTCRayHit16 ray;
    for (unsigned i = 0; i < kPacket; ++i) {
      set_ray(ray.ray, i, from, directions[first + i]);
      ray.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      ray.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid.data(), scene, &context, &ray);
    for (unsigned i = 0; i < kPacket; ++i) {
      if (ray.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      ++sums.covered;
      sums.light +=
          light(ray.hit.primID[i], ray.hit.u[i], ray.hit.v[i],
                {ray.hit.Ng_x[i], ray.hit.Ng_y[i], ray.hit.Ng_z[i]}, directions[first + i]);
    }
  }
  return sums;
}

}  // namespace

Shading RayBaseline::trace(const Receiver& receiver, Job job, Packets packets, unsigned rays,
                           std::uint64_t seed) const {
  // Choose the directions
  const std::size_t exponent = static_cast<std::size_t>(std::countr_zero(rays));
  if (!std::has_single_bit(rays) || rays < kPacket || exponent >= impl_->orders.size()) {
    throw std::invalid_argument(
        "RayBaseline: the number of rays must be a power of two from 16 to 65536");
  }
  const glm::vec3 from(receiver.position - impl_->origin);
  const Basis frame(receiver.normal);
  const SquarePoints points(seed);
  std::vector<glm::vec3> directions(rays);
  std::ranges::transform(impl_->orders[exponent], directions.begin(), [&](std::uint32_t i) {
    return frame.to_world(cosine_direction(points.square(i)));
  });
  // Trace them
  const auto light = [&](unsigned primitive, float u, float v, const glm::vec3& normal,
                         const glm::vec3& along) {
    return impl_->radiance(primitive, u, v, normal, along);
  };
  const bool single = packets == Packets::single;
  const Sums sums = job == Job::occlusion ? (single ? occlude_single : occlude_packets)(
                                                impl_->scene, from, directions)
                    : single ? intersect_single(impl_->scene, from, directions, light)
                             : intersect_packets(impl_->scene, from, directions, light);
  // Each ray has the same weight
  Shading shading;
  shading.occlusion = static_cast<float>(sums.covered) / static_cast<float>(rays);
  shading.irradiance = sums.light * (std::numbers::pi_v<float> / static_cast<float>(rays));
  return shading;
}

}  // namespace ptc::bench
