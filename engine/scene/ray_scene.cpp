// Embree's device and scene behind two queries, and the surface data at a hit.
//
// Embree computes in float, which has 24 bits: a scene far from zero, or a ray that begins far
// outside, would lose the mesh in rounding. So every ray goes through three frames, all parallel:
//
//     world (double)  --- minus Mesh::origin, minus middle --->  local (double)
//     local (double)  --- step to the box around the mesh  --->  Embree (float)
//
//                        +-----------+
//      o - - - skipped - |--> mesh   |   The first part of the ray is skipped in double, so that
//                        +-----------+   the float origin lies at the box.
//
// A hit comes back as a triangle and two barycentric coordinates, and its position is computed
// again from the corners in double.
#include "engine/scene/ray_scene.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "engine/base/embree.h"
#include "engine/base/error.h"
#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"
#include "engine/scene/texture.h"

namespace ptc {
namespace {

// Reports whether Embree can take a vector. Its own limit is 1.8e18, and it does not check that a
// ray keeps to it. Comparisons with a NaN are false.
bool is_sane(const glm::vec3& v) {
  constexpr float kMax = 1e18f;
  return std::abs(v.x) <= kMax && std::abs(v.y) <= kMax && std::abs(v.z) <= kMax;
}

// Returns the unit vector along v, or the fallback when v has no direction.
glm::dvec3 direction_of(const glm::dvec3& v, const glm::dvec3& fallback) {
  // Scale first, because the square of a tiny triangle's normal underflows.
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(largest > 0) || !std::isfinite(largest)) return fallback;
  return glm::normalize(v / largest);
}

// A ray in Embree's frame.
struct LocalRay {
  glm::vec3 origin;
  glm::vec3 direction;
  float near;
  float far;
  double skipped;  // how far the origin was moved along the ray
};

RTCRay to_embree(const LocalRay& ray) {
  RTCRay out{};
  out.org_x = ray.origin.x;
  out.org_y = ray.origin.y;
  out.org_z = ray.origin.z;
  out.dir_x = ray.direction.x;
  out.dir_y = ray.direction.y;
  out.dir_z = ray.direction.z;
  out.tnear = ray.near;
  out.tfar = ray.far;
  out.mask = ~0u;
  return out;
}

// An interval of t on the line origin + t direction; it is empty when begin > end.
struct Stretch {
  double begin = -std::numeric_limits<double>::infinity();
  double end = std::numeric_limits<double>::infinity();
};

// Returns the stretch of a line inside the box of half extents `half` around zero, by clipping the
// line with the three pairs of planes (Kay and Kajiya 1986).
Stretch inside_box(const glm::dvec3& origin, const glm::dvec3& direction, const glm::dvec3& half) {
  Stretch s;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > half[axis]) return {1, 0};
      continue;
    }
    const double a = (-half[axis] - origin[axis]) / direction[axis];
    const double b = (half[axis] - origin[axis]) / direction[axis];
    s.begin = std::max(s.begin, std::min(a, b));
    s.end = std::min(s.end, std::max(a, b));
  }
  return s;
}

// Returns a number in [0, 1) that depends on the ray and the triangle alone.
float luck_of(const RTCRay& ray, std::uint32_t triangle) {
  std::uint64_t luck = triangle;
  for (const float part : {ray.org_x, ray.org_y, ray.org_z, ray.dir_x, ray.dir_y, ray.dir_z})
    luck = splitmix64(luck ^ std::bit_cast<std::uint32_t>(part));
  return to_unit(static_cast<std::uint32_t>(luck >> 32));
}

// Checks the numbers of a material.
void check_material(const Material& material, const char* field) {
  for (int k = 0; k < 3; ++k) {
    require_request(material.albedo[k] >= 0 && material.albedo[k] <= 1, field,
                    "mesh: the albedo of a material is not 0 to 1");
    require_request(material.emission[k] >= 0 && std::isfinite(material.emission[k]), field,
                    "mesh: the emission of a material is negative or not finite");
  }
  require_request(material.opacity >= 0 && material.opacity <= 1, field,
                  "mesh: the opacity of a material is not 0 to 1");
}

}  // namespace

void check_mesh(const Mesh& mesh, const char* field) {
  const std::size_t vertices = mesh.positions.size();
  require_request(mesh.normals.empty() || mesh.normals.size() == vertices, field,
                  "mesh: the number of normals differs from that of vertices");
  require_request(mesh.uvs.empty() || mesh.uvs.size() == vertices, field,
                  "mesh: the number of texture coordinates differs from that of vertices");
  require_request(mesh.colours.empty() || mesh.colours.size() == vertices, field,
                  "mesh: the number of colours differs from that of vertices");
  for (const glm::vec3& colour : mesh.colours) {
    for (int k = 0; k < 3; ++k)
      require_request(colour[k] >= 0 && colour[k] <= 1, field,
                      "mesh: the colour of a vertex is not 0 to 1");
  }
  require_request(mesh.material_of.size() == mesh.triangles.size(), field,
                  "mesh: the number of material indices differs from that of triangles");
  for (const glm::vec3& p : mesh.positions)
    require_request(is_sane(p), field,
                    "mesh: a position is not finite or beyond 1e18: scale the mesh");
  for (const auto& corners : mesh.triangles) {
    for (const std::uint32_t corner : corners)
      require_request(corner < vertices, field, "mesh: a triangle has a vertex index out of range");
  }
  for (const std::uint16_t material : mesh.material_of) {
    require_request(material < mesh.materials.size(), field,
                    "mesh: a triangle has a material index out of range");
  }
  require_request(mesh.objects.empty() == mesh.object_runs.empty() &&
                      (mesh.objects.empty() || mesh.object_runs.front().first == 0),
                  field, "mesh: its objects do not begin with its triangles");
  for (std::size_t i = 0; i < mesh.object_runs.size(); ++i) {
    const ObjectRun& run = mesh.object_runs[i];
    require_request(run.object < mesh.objects.size() && run.first < mesh.triangles.size() &&
                        (i == 0 || run.first > mesh.object_runs[i - 1].first),
                    field, "mesh: a run of triangles has no object, or is out of order");
  }
  require_request(std::ranges::all_of(mesh.normals, is_sane), field,
                  "mesh: a normal is not finite or beyond 1e18");
  require_request(fits_coordinates(mesh.origin), field, "mesh: the origin is not finite");
  for (const Material& material : mesh.materials) check_material(material, field);
}

struct RayScene::Impl {
  explicit Impl(const Mesh& source);

  // Finds the middle and the extent of the mesh, and from them the epsilon.
  void measure();
  // Hands the mesh to Embree and builds its tree.
  void build();
  // Embree's filter: takes out the hits that do not count. @pre its user data is an Impl
  static void let_through(const RTCFilterFunctionNArguments* arguments);
  // Returns a ray in Embree's frame, or nothing when it cannot meet the mesh.
  [[nodiscard]] std::optional<LocalRay> localise(const glm::dvec3& origin,
                                                 const glm::vec3& direction, double near,
                                                 double far) const;
  // Returns the interpolated normal, mirrored where it points to the back of the triangle.
  [[nodiscard]] glm::dvec3 shading_normal(const std::array<std::uint32_t, 3>& corners, double u,
                                          double v, const glm::dvec3& geometric) const;
  // Returns the colour of the vertices at a point of a triangle; white without any.
  [[nodiscard]] glm::vec3 colour_at(const std::array<std::uint32_t, 3>& corners, float u,
                                    float v) const {
    if (mesh.colours.empty()) return glm::vec3(1);
    return (1 - u - v) * mesh.colours[corners[0]] + u * mesh.colours[corners[1]] +
           v * mesh.colours[corners[2]];
  }
  // Returns the colour of a texture at a place on a triangle; white without a texture.
  [[nodiscard]] glm::vec3 texture_at(const Texture* texture, const TextureWrap& wrap,
                                     std::uint32_t triangle, float u, float v) const;

  const Mesh& mesh;
  std::atomic<std::int64_t> bytes = 0;  // that Embree holds, as its monitor reports them
  glm::vec3 middle{0};                  // the zero of Embree's frame, relative to Mesh::origin
  glm::dvec3 half_extent{0};
  double epsilon = 0;
  Owned<RTCDevice, rtcReleaseDevice> device;
  Owned<RTCScene, rtcReleaseScene> scene;
};

RayScene::Impl::Impl(const Mesh& source)
    : mesh((check_mesh(source), source)),
      device(rtcNewDevice("set_affinity=0")),
      scene(device != nullptr ? rtcNewScene(device) : nullptr) {
  check_device(device);
  rtcSetDeviceMemoryMonitorFunction(
      device,
      [](void* self, ssize_t change, bool) {
        static_cast<Impl*>(self)->bytes += change;
        return true;
      },
      this);
  measure();
  if (!mesh.triangles.empty()) build();
}

void RayScene::Impl::measure() {
  if (mesh.positions.empty()) return;
  glm::vec3 low = mesh.positions.front();
  glm::vec3 high = low;
  for (const glm::vec3& p : mesh.positions) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  middle = 0.5f * low + 0.5f * high;
  half_extent =
      glm::max(glm::dvec3(high) - glm::dvec3(middle), glm::dvec3(middle) - glm::dvec3(low));
  const double largest = std::max({half_extent.x, half_extent.y, half_extent.z});
  constexpr double kUlps = 16 * static_cast<double>(std::numeric_limits<float>::epsilon());
  epsilon = std::max(kUlps * largest, static_cast<double>(std::numeric_limits<float>::min()));
}

void RayScene::Impl::build() {
  // Copy the positions, relative to the middle, and share the triangles.
  const Owned<RTCGeometry, rtcReleaseGeometry> geometry(
      rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* const positions = static_cast<glm::vec3*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(glm::vec3), mesh.positions.size()));
  check_device(device);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) positions[i] = mesh.positions[i] - middle;
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             mesh.triangles.data(), 0, sizeof(mesh.triangles.front()),
                             mesh.triangles.size());
  if (!mesh.is_opaque()) {
    rtcSetGeometryUserData(geometry, this);
    rtcSetGeometryIntersectFilterFunction(geometry, let_through);
    rtcSetGeometryOccludedFilterFunction(geometry, let_through);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  // Build a robust tree: watertight at edges, and what a ray hits does not depend on the shape of
  // the tree.
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcCommitScene(scene);
  check_device(device);
}

void RayScene::Impl::let_through(const RTCFilterFunctionNArguments* arguments) {
  const Mesh& mesh = static_cast<const Impl*>(arguments->geometryUserPtr)->mesh;
  const unsigned count = arguments->N;
  for (unsigned i = 0; i < count; ++i) {
    if (arguments->valid[i] == 0) continue;
    const std::uint32_t triangle = RTCHitN_primID(arguments->hit, count, i);
    const float opacity = opacity_at(
        mesh, triangle, {RTCHitN_u(arguments->hit, count, i), RTCHitN_v(arguments->hit, count, i)});
    if (opacity >= 1) continue;
    if (luck_of(rtcGetRayFromRayN(arguments->ray, count, i), triangle) >= opacity)
      arguments->valid[i] = 0;
  }
}

// A ray that begins far outside starts where it enters the box around the mesh, so that its origin
// keeps the precision of the mesh when it becomes float.
std::optional<LocalRay> RayScene::Impl::localise(const glm::dvec3& origin,
                                                 const glm::vec3& direction, double near,
                                                 double far) const {
  // Move the origin to the middle of the mesh.
  const glm::dvec3 local = (origin - mesh.origin) - glm::dvec3(middle);
  const glm::dvec3 along(direction);
  // Skip the part of the ray before the box.
  double skipped = 0;
  if (glm::any(glm::greaterThan(glm::abs(local), half_extent + epsilon))) {
    const Stretch inside = inside_box(local, along, half_extent + 2 * epsilon);
    // Negated, so that a ray with a NaN in it misses.
    if (!(inside.begin <= inside.end && inside.end >= near && inside.begin <= far)) return {};
    skipped = std::max(inside.begin, 0.0);
  }
  // Round to float, and refuse what Embree cannot take.
  const LocalRay ray{glm::vec3(local + along * skipped), direction,
                     static_cast<float>(std::max(near - skipped, 0.0)),
                     static_cast<float>(far - skipped), skipped};
  if (!is_sane(ray.origin) || !is_sane(direction) || !(ray.near <= ray.far)) return {};
  return ray;
}

glm::dvec3 RayScene::Impl::shading_normal(const std::array<std::uint32_t, 3>& corners, double u,
                                          double v, const glm::dvec3& geometric) const {
  if (mesh.normals.empty()) return geometric;
  const glm::dvec3 blended = (1 - u - v) * glm::dvec3(mesh.normals[corners[0]]) +
                             u * glm::dvec3(mesh.normals[corners[1]]) +
                             v * glm::dvec3(mesh.normals[corners[2]]);
  const glm::dvec3 normal = direction_of(blended, geometric);
  if (!std::isfinite(glm::dot(normal, geometric))) return geometric;
  const double side = glm::dot(normal, geometric);
  return side < 0 ? normal - 2 * side * geometric : normal;  // mirror it at the surface
}

glm::vec3 RayScene::Impl::texture_at(const Texture* texture, const TextureWrap& wrap,
                                     std::uint32_t triangle, float u, float v) const {
  if (texture == nullptr || mesh.uvs.empty()) return glm::vec3(1);
  return sample_texture(*texture, uv_at(mesh, triangle, {u, v}), wrap);
}

RayScene::RayScene(const Mesh& mesh) : impl_(std::make_unique<Impl>(mesh)) {}
RayScene::~RayScene() = default;

std::uint64_t RayScene::bytes() const noexcept {
  return static_cast<std::uint64_t>(impl_->bytes.load());
}

const Mesh& RayScene::mesh() const noexcept {
  return impl_->mesh;
}

double RayScene::epsilon() const noexcept {
  return impl_->epsilon;
}

std::optional<SurfaceHit> RayScene::closest(const glm::dvec3& origin, const glm::vec3& direction,
                                            double near, double far) const {
  const auto found = closest_triangle(origin, direction, near, far);
  if (!found) return {};
  SurfaceHit hit = surface(found->triangle, found->u, found->v);
  hit.distance = found->distance;
  hit.front = found->front;
  return hit;
}

std::optional<TriangleHit> RayScene::closest_triangle(const glm::dvec3& origin,
                                                      const glm::vec3& direction, double near,
                                                      double far) const {
  const std::optional<LocalRay> local = impl_->localise(origin, direction, near, far);
  if (!local) return {};
  RTCRayHit query{};
  query.ray = to_embree(*local);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(impl_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const Mesh& mesh = impl_->mesh;
  const auto& corners = mesh.triangles[query.hit.primID];
  const glm::dvec3 a(mesh.positions[corners[0]]);
  const glm::dvec3 normal = glm::cross(glm::dvec3(mesh.positions[corners[1]]) - a,
                                       glm::dvec3(mesh.positions[corners[2]]) - a);
  return TriangleHit{.distance = local->skipped + static_cast<double>(query.ray.tfar),
                     .triangle = query.hit.primID,
                     .u = query.hit.u,
                     .v = query.hit.v,
                     .front = glm::dot(normal, glm::dvec3(direction)) < 0};
}

bool RayScene::occluded(const glm::dvec3& origin, const glm::vec3& direction, double near,
                        double far) const {
  const std::optional<LocalRay> local = impl_->localise(origin, direction, near, far);
  if (!local) return false;
  RTCRay ray = to_embree(*local);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->scene, &context, &ray);
  return ray.tfar < 0;
}

std::uint32_t RayScene::occluded(const glm::dvec3& origin, std::span<const glm::vec3> directions,
                                 double near, double far) const {
  alignas(64) std::array<int, kRaysAtOnce> valid{};
  RTCRay16 rays{};
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const std::optional<LocalRay> local = impl_->localise(origin, directions[i], near, far);
    if (!local) continue;
    valid[i] = -1;
    rays.org_x[i] = local->origin.x;
    rays.org_y[i] = local->origin.y;
    rays.org_z[i] = local->origin.z;
    rays.dir_x[i] = directions[i].x;
    rays.dir_y[i] = directions[i].y;
    rays.dir_z[i] = directions[i].z;
    rays.tnear[i] = local->near;
    rays.tfar[i] = local->far;
    rays.mask[i] = ~0U;
  }
  if (std::ranges::all_of(valid, [](int v) { return v == 0; })) return 0;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded16(valid.data(), impl_->scene, &context, &rays);
  std::uint32_t hidden = 0;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (valid[i] != 0 && rays.tfar[i] < 0) hidden |= 1U << i;
  }
  return hidden;
}

bool RayScene::is_plain(std::uint32_t triangle) const {
  const Mesh& mesh = impl_->mesh;
  const Material& material = mesh.materials[mesh.material_of[triangle]];
  return mesh.normals.empty() && mesh.colours.empty() && !material.texture &&
         !material.emission_texture && material.is_opaque();
}

SurfaceHit RayScene::surface(std::uint32_t triangle, float u, float v) const {
  const Mesh& mesh = impl_->mesh;
  if (triangle >= mesh.triangles.size())
    throw std::invalid_argument("RayScene: the triangle's index is out of range");
  const auto& corners = mesh.triangles[triangle];
  const glm::dvec3 a(mesh.positions[corners[0]]);
  const glm::dvec3 ab = glm::dvec3(mesh.positions[corners[1]]) - a;
  const glm::dvec3 ac = glm::dvec3(mesh.positions[corners[2]]) - a;
  const glm::dvec3 geometric = direction_of(glm::cross(ab, ac), glm::dvec3(0, 0, 1));
  const double u_wide = static_cast<double>(u);
  const double v_wide = static_cast<double>(v);
  const Material& material = mesh.materials[mesh.material_of[triangle]];

  SurfaceHit hit;
  hit.triangle = triangle;
  hit.position = mesh.origin + (a + u_wide * ab + v_wide * ac);
  hit.geometric_normal = glm::vec3(geometric);
  hit.normal = glm::vec3(impl_->shading_normal(corners, u_wide, v_wide, geometric));
  hit.albedo = material.albedo *
               impl_->texture_at(material.texture.get(), material.wrap, triangle, u, v) *
               impl_->colour_at(corners, u, v);
  hit.emission = material.emission * impl_->texture_at(material.emission_texture.get(),
                                                       material.emission_wrap, triangle, u, v);
  hit.opacity = opacity_at(mesh, triangle, {u, v});
  return hit;
}

}  // namespace ptc
