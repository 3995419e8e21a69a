#include "engine/pipeline/render/primary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

#include "engine/pipeline/render/clearance.h"
#include "engine/pipeline/render/overview.h"
#include "engine/pipeline/scene_record.h"

namespace ptc {
namespace {

/// Share of the lift by which receivers step back along the ray that found them.
constexpr float kStepBack = 0.5F;

/// A view by rays: one ray for each sample, lit by shadow rays at the place that it meets.
class MeshView : public PrimaryView {
 public:
  MeshView(const RayScene& scene, const DirectLight& light, const LightSampling& sampling,
           const Camera& camera, unsigned side, float lift)
      : scene_(scene),
        light_(light),
        sampling_(sampling),
        camera_(camera),
        forward_(axes_of(camera).forward),
        side_(side),
        lift_(lift) {}

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override {
    const float scale = 1.0F / static_cast<float>(side_);
    const glm::vec3 direction = camera_.direction((static_cast<float>(x) + 0.5F) * scale,
                                                  (static_cast<float>(y) + 0.5F) * scale);
    const auto hit =
        scene_.closest(camera_.position, direction, 0, std::numeric_limits<double>::infinity());
    if (!hit) return std::nullopt;
    PrimaryHit seen =
        seen_of_mesh(scene_, light_, sampling_, *hit, direction, lift_, std::uint64_t{y} << 32 | x);
    seen.position =
        clear_of_walls(scene_, hit->position, seen.offset_normal, direction, double{lift_});
    seen.depth = static_cast<float>(hit->distance * glm::dot(glm::dvec3(direction), forward_));
    return seen;
  }

 private:
  const RayScene& scene_;
  const DirectLight& light_;
  LightSampling sampling_;
  Camera camera_;
  glm::dvec3 forward_;
  unsigned side_;
  float lift_;
};

}  // namespace

PrimaryHit seen_of_mesh(const RayScene& scene, const DirectLight& light,
                        const LightSampling& sampling, const SurfaceHit& at,
                        const glm::vec3& towards, float lift, std::uint64_t seed) {
  const float turn = at.front ? 1.0F : -1.0F;
  // Step back the way that the place is looked at along, for views that do not look for walls: a
  // receiver in an edge would else lie behind the discs of the other side, which are clear to it
  const glm::dvec3 place = at.position - glm::dvec3(towards) * double{kStepBack * lift};
  const glm::dvec3 geometric(at.geometric_normal * turn);
  PrimaryHit primary{.position = place,
                     .surface = at.position + (geometric - glm::dvec3(towards)) * scene.epsilon(),
                     .normal = at.normal * turn,
                     .lift = lift,
                     .offset_normal = at.geometric_normal * turn,
                     .albedo = at.albedo,
                     .triangle = at.triangle};
  primary.lamps = light.irradiance(primary.surface, primary.normal, sampling, seed).local;
  primary.direct = primary.albedo * primary.lamps * std::numbers::inv_pi_v<float>;
  if (at.front) primary.direct += at.emission;
  return primary;
}

std::unique_ptr<PrimaryView> view_mesh(const RayScene& scene, const DirectLight& light,
                                       const LightSampling& sampling, const Camera& camera,
                                       unsigned side, float lift) {
  return std::make_unique<MeshView>(scene, light, sampling, camera, side, lift);
}

Camera camera_of(const MeshCamera& from, const std::optional<std::array<unsigned, 2>>& size) {
  Camera camera;
  const std::array<unsigned, 2> pixels = size.value_or(from.size);
  if (pixels[0] > 0 && pixels[1] > 0) {
    camera.width = pixels[0];
    camera.height = pixels[1];
  }
  const float aspect = static_cast<float>(camera.width) / static_cast<float>(camera.height);
  camera.position = from.position;
  camera.look_at = from.position + glm::dvec3(from.forward);
  camera.up = from.up;
  camera.vertical_fov = 2 * std::atan(std::tan(from.horizontal_fov * 0.5F) / aspect);
  return camera;
}

Camera default_camera(const ContainerReader& scene, std::span<const MeshCamera> cameras,
                      const std::optional<Bounds>& subject,
                      const std::optional<std::array<unsigned, 2>>& size) {
  const auto& text = scene.meta().text;
  if (const auto recorded = text.find(kCameraKey); recorded != text.end())
    return camera_from_json(recorded->second);
  if (cameras.empty()) return overview(scene, up_of(text), subject, size);
  return camera_of(cameras.front(), size);
}

}  // namespace ptc
