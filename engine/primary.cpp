#include "engine/primary.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/io/record.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

class MeshView : public PrimaryView {
 public:
  MeshView(const RayScene& scene, const DirectLight& light, const LightSampling& sampling, const Camera& camera,
           unsigned side, float lift)
      : scene_(scene), light_(light), sampling_(sampling), camera_(camera), side_(side), lift_(lift) {}

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override {
    const float scale = 1.0F / static_cast<float>(side_);
    const glm::vec3 direction =
        camera_.direction((static_cast<float>(x) + 0.5F) * scale, (static_cast<float>(y) + 0.5F) * scale);
    const auto hit = scene_.closest(camera_.position, direction, 0, std::numeric_limits<double>::infinity());
    if (!hit) return std::nullopt;
    const float turn = hit->front ? 1.0F : -1.0F;
    PrimaryHit primary{.position = hit->position,
                       .normal = hit->normal * turn,
                       .lift = lift_,
                       .offset_normal = hit->geometric_normal * turn,
                       .albedo = hit->albedo};
    const std::uint64_t seed = std::uint64_t{y} << 32 | x;
    const DirectLight::Result light =
        light_.irradiance(primary.position + glm::dvec3(primary.offset_normal) * scene_.epsilon(), primary.normal,
                          sampling_, seed);
    primary.direct = primary.albedo * light.local * std::numbers::inv_pi_v<float>;
    if (hit->front) primary.direct += hit->emission;
    return primary;
  }

 private:
  const RayScene& scene_;
  const DirectLight& light_;
  LightSampling sampling_;
  Camera camera_;
  unsigned side_;
  float lift_;
};

/// Perspective depth buffer of discs.
class SurfelView : public PrimaryView {
 public:
  SurfelView(const ContainerReader& scene, const Camera& camera, unsigned side, float lift, Progress& progress)
      : camera_(camera), side_(side), lift_(lift), samples_(std::size_t{width()} * height()) {
    const glm::vec3 middle = direction(static_cast<float>(width()) * 0.5F, static_cast<float>(height()) * 0.5F);
    forward_ = middle;
    right_ = glm::normalize(glm::cross(forward_, camera.up));
    down_ = glm::cross(forward_, right_);
    focal_ = static_cast<float>(height()) * 0.5F / std::tan(camera.vertical_fov * 0.5F);
    std::vector<std::byte> payload(scene.page_payload_limit());
    PageDecoder decoder;
    for (const std::uint32_t page : scene.point_pages()) {
      const PageHeader header = scene.read_page(page, payload, decoder);
      const PointPage points(payload.data(), header.record_count);
      for (std::uint32_t i = 0; i < points.size(); ++i) draw(to_surfel(points[i], scene.superblock().frame));
      progress.advance(points.size());
    }
  }

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override {
    const Sample& s = samples_[std::size_t{y} * width() + x];
    if (s.depth == std::numeric_limits<float>::infinity()) return std::nullopt;
    const glm::vec3 along = direction(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
    const std::array<float, 3> n = decode_octahedral(s.normal[0], s.normal[1]);
    const std::array<float, 3> radiance = decode_rgbe(s.radiance);
    glm::vec3 normal(n[0], n[1], n[2]);
    const bool back = glm::dot(normal, along) > 0;
    if (back) normal = -normal;
    PrimaryHit hit{.position = camera_.position + glm::dvec3(along) * static_cast<double>(s.depth),
                   .normal = normal,
                   .lift = lift_ * decode_ufloat16(s.radius),
                   .offset_normal = normal,
                   .sky_included = true};
    for (int c = 0; c < 3; ++c) hit.albedo[c] = static_cast<float>(s.albedo[static_cast<std::size_t>(c)]) / 255;
    if (!back) hit.direct = glm::vec3(radiance[0], radiance[1], radiance[2]);
    return hit;
  }

 private:
  struct Sample {
    float depth = std::numeric_limits<float>::infinity();  // along the ray
    std::uint32_t radiance = 0;
    std::array<std::int16_t, 2> normal{};
    std::uint16_t radius = 0;
    std::array<std::uint8_t, 3> albedo{};
  };

  [[nodiscard]] unsigned width() const { return camera_.width * side_; }
  [[nodiscard]] unsigned height() const { return camera_.height * side_; }
  [[nodiscard]] glm::vec3 direction(float x, float y) const {
    const float scale = 1.0F / static_cast<float>(side_);
    return camera_.direction(x * scale, y * scale);
  }

  void draw(const Surfel& surfel) {
    const glm::vec3 to(surfel.position - camera_.position);
    const float depth = glm::dot(to, forward_);
    const float reach = surfel.radius;
    const float near = depth - reach;
    if (depth + reach <= 0 || !(surfel.radius > 0)) return;
    int x0 = 0, y0 = 0, x1 = static_cast<int>(width()), y1 = static_cast<int>(height());
    if (near > 1e-3F * depth) {  // else the disc surrounds the camera: every sample is tested
      const auto span = [&](float at, unsigned size, int& first, int& last) {
        const float middle = static_cast<float>(size) * 0.5F + focal_ * at / depth;
        const float half = focal_ * (reach + std::abs(at) * reach / depth) / near + 1;
        first = static_cast<int>(std::clamp(middle - half, 0.0F, static_cast<float>(size)));
        last = static_cast<int>(std::clamp(middle + half + 1, 0.0F, static_cast<float>(size)));
      };
      span(glm::dot(to, right_), width(), x0, x1);
      span(glm::dot(to, down_), height(), y0, y1);
    }
    const Sample drawn = sample_of(surfel);
    const float height_above = glm::dot(to, surfel.normal);
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        const glm::vec3 along = direction(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
        const float t = height_above / glm::dot(along, surfel.normal);
        const glm::vec3 off = along * t - to;
        const float square = glm::dot(off, off);
        if (!(t > 0 && square < reach * reach)) continue;
        // The nearest centre wins where coplanar discs overlap, as in the gather.
        const float bumped = t + 0.01F / reach * square;
        Sample& s = samples_[static_cast<std::size_t>(y) * width() + static_cast<std::size_t>(x)];
        if (bumped >= s.depth) continue;
        s = drawn;
        s.depth = bumped;
      }
    }
  }

  [[nodiscard]] static Sample sample_of(const Surfel& s) {
    Sample sample{.radiance = encode_rgbe({s.radiance.r, s.radiance.g, s.radiance.b}),
                  .normal = encode_octahedral({s.normal.x, s.normal.y, s.normal.z}),
                  .radius = encode_ufloat16(s.radius)};
    for (int c = 0; c < 3; ++c) {
      sample.albedo[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(std::lround(s.albedo[c] * 255));
    }
    return sample;
  }

  Camera camera_;
  unsigned side_;
  float lift_;
  glm::vec3 forward_, right_, down_;
  float focal_;  // in samples
  std::vector<Sample> samples_;
};

}  // namespace

std::unique_ptr<PrimaryView> view_mesh(const RayScene& scene, const DirectLight& light, const LightSampling& sampling,
                                       const Camera& camera, unsigned side, float lift) {
  return std::make_unique<MeshView>(scene, light, sampling, camera, side, lift);
}

std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene, const Camera& camera, unsigned side, float lift,
                                          Progress& progress) {
  return std::make_unique<SurfelView>(scene, camera, side, lift, progress);
}

}  // namespace ptc
