// Embree rays at oriented discs (engine/shade/brute_force.h).
#include <embree3/rtcore.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <glm/geometric.hpp>

#include "engine/shade/brute_force.h"

namespace ptc {
namespace {

constexpr float kPi = 3.14159265F;
constexpr float kBump = 0.01F;  // height of the paraboloid over the disc's radius, as draw_discs()

/// SplitMix64 (Steele, Lea and Flood 2014): a stream of uniform numbers in [0, 1).
class Uniform {
 public:
  explicit Uniform(std::uint64_t seed) : state_(seed) {}
  float operator()() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return static_cast<float>((z ^ (z >> 31)) >> 40) * 0x1p-24F;
  }

 private:
  std::uint64_t state_;
};

}  // namespace

struct DiscRays::Impl {
  struct Context {
    RTCIntersectContext embree;  // first: Embree hands back a pointer to it
    const Impl* discs;
    bool choose = false;  // second pass: keep the disc with the least bumped depth
    float best = std::numeric_limits<float>::infinity();
    unsigned best_disc = RTC_INVALID_GEOMETRY_ID;
  };

  std::span<const Surfel> surfels;
  Sides sides;
  std::function<glm::vec3(const glm::vec3&)> sky;
  glm::dvec3 origin{0};
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }

  [[nodiscard]] glm::vec3 centre(unsigned i) const { return glm::vec3(surfels[i].position - origin); }

  /// One candidate of one ray: whether the disc stops it, and which of overlapping discs wins.
  static void filter(const RTCFilterFunctionNArguments* args) {
    if (args->valid[0] != -1) return;
    const auto& ray = *reinterpret_cast<const RTCRay*>(args->ray);
    const auto& hit = *reinterpret_cast<const RTCHit*>(args->hit);
    auto& context = *reinterpret_cast<Context*>(args->context);
    const Surfel& disc = context.discs->surfels[hit.primID];
    const glm::vec3 from(ray.org_x, ray.org_y, ray.org_z), along(ray.dir_x, ray.dir_y, ray.dir_z);
    const glm::vec3 to = context.discs->centre(hit.primID) - from;
    const bool back = glm::dot(to, disc.normal) >= 0;
    if (back && (context.discs->sides == Sides::front || glm::dot(to, to) < 4 * disc.radius * disc.radius)) {
      args->valid[0] = 0;
      return;
    }
    if (!context.choose) return;
    const glm::vec3 off = along * ray.tfar - to;
    const float depth = ray.tfar + kBump / disc.radius * glm::dot(off, off);
    if (depth < context.best) {
      context.best = depth;
      context.best_disc = hit.primID;
    }
    args->valid[0] = 0;
  }

  [[nodiscard]] static RTCRayHit make_ray(const glm::vec3& from, const glm::vec3& along, float near, float far) {
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

  /// The disc that a ray meets first, or RTC_INVALID_GEOMETRY_ID.
  [[nodiscard]] unsigned meet(const glm::vec3& from, const glm::vec3& along) const {
    Context context{};
    rtcInitIntersectContext(&context.embree);
    context.discs = this;
    RTCRayHit ray = make_ray(from, along, 0, std::numeric_limits<float>::infinity());
    rtcIntersect1(scene, &context.embree, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return RTC_INVALID_GEOMETRY_ID;
    const unsigned first = ray.hit.primID;
    const float t = ray.ray.tfar;
    context.choose = true;
    const float slack = 1e-6F * t;
    RTCRayHit again = make_ray(from, along, t - slack, t + kBump * surfels[first].radius + slack);
    rtcIntersect1(scene, &context.embree, &again);
    return context.best_disc == RTC_INVALID_GEOMETRY_ID ? first : context.best_disc;
  }
};

DiscRays::DiscRays(std::span<const Surfel> surfels, Sides sides, std::function<glm::vec3(const glm::vec3&)> sky)
    : impl_(std::make_unique<Impl>()) {
  impl_->surfels = surfels;
  impl_->sides = sides;
  impl_->sky = std::move(sky);
  Bounds bounds;
  for (const Surfel& s : surfels) bounds.add(s.position);
  if (!bounds.empty()) impl_->origin = (bounds.low + bounds.high) * 0.5;
  impl_->device = rtcNewDevice(nullptr);
  if (!impl_->device) throw std::runtime_error("Embree: no device");
  impl_->scene = rtcNewScene(impl_->device);
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT4, 16, surfels.size()));
  auto* normals = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_NORMAL, 0,
                                                              RTC_FORMAT_FLOAT3, 12, surfels.size()));
  if (surfels.size() > 0 && (!vertices || !normals)) throw std::bad_alloc();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const glm::vec3 c = impl_->centre(static_cast<unsigned>(i));
    for (int k = 0; k < 3; ++k) {
      vertices[4 * i + static_cast<std::size_t>(k)] = c[k];
      normals[3 * i + static_cast<std::size_t>(k)] = surfels[i].normal[k];
    }
    vertices[4 * i + 3] = surfels[i].radius;
  }
  rtcSetGeometryIntersectFilterFunction(geometry, &Impl::filter);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(impl_->scene);
}

DiscRays::~DiscRays() = default;

Shading DiscRays::trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const {
  const auto side = static_cast<unsigned>(std::sqrt(static_cast<double>(rays)));
  const glm::vec3 from(receiver.position - impl_->origin);
  const glm::vec3 n = receiver.normal;
  const glm::vec3 tangent = glm::normalize(glm::cross(n, std::abs(n.x) > 0.6F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0)));
  const glm::vec3 bitangent = glm::cross(n, tangent);
  Uniform uniform(seed);
  unsigned covered = 0;
  glm::dvec3 light(0), sky(0), open(0);
  for (unsigned j = 0; j < side; ++j) {
    for (unsigned i = 0; i < side; ++i) {
      const float u = (static_cast<float>(i) + uniform()) / static_cast<float>(side);
      const float angle = 2 * kPi * (static_cast<float>(j) + uniform()) / static_cast<float>(side);
      const float sine = std::sqrt(u);
      const glm::vec3 along = tangent * (sine * std::cos(angle)) + bitangent * (sine * std::sin(angle)) +
                              n * std::sqrt(std::max(0.0F, 1 - u));
      const unsigned disc = impl_->meet(from, along);
      if (disc == RTC_INVALID_GEOMETRY_ID) {
        open += along;
        if (impl_->sky) sky += impl_->sky(along);
        continue;
      }
      ++covered;
      if (glm::dot(along, impl_->surfels[disc].normal) < 0) light += impl_->surfels[disc].radiance;
    }
  }
  const double count = static_cast<double>(side) * side;
  Shading shading;
  shading.occlusion = static_cast<float>(covered / count);
  shading.irradiance = glm::vec3(light * (std::numbers::pi / count));
  shading.sky = glm::vec3(sky * (std::numbers::pi / count));
  const double length = glm::length(open);
  shading.bent_normal = length > 0 ? glm::vec3(open / length) : n;
  return shading;
}

}  // namespace ptc
