// Draws discs into a depth buffer (splat_view.h).
//
// The image of a disc is an ellipse: span() finds the extent of the ellipse along an axis, cover()
// tests every sample within. Bands of 16 rows of samples are drawn in parallel, each in the order
// of the points. A sample belongs to one band, so the picture does not depend on the number of
// threads.
#include "engine/pipeline/render/splat_view.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/pipeline/scene_record.h"
#include "engine/shade/lift.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr unsigned kBandRows = 16;  // rows of samples that one thread draws

/// A disc in front of the camera, in the camera's axes: x to the right, y down, z forward. Lengths
/// are in edges of the frame.
struct Projected {
  glm::vec3 centre{0}, normal{0};
  float radius = 0;
  unsigned x0 = 0, x1 = 0, y0 = 0, y1 = 0;  // samples that it may cover, [x0, x1) x [y0, y1)
  SplatPayload payload;
};

/// A view of the surfels of a source.
class DrawnView : public SplatView {
 public:
  using SplatView::SplatView;

  /// Draws the surfels of a source.
  void draw(PointSource& source, const Executor& executor) {
    begin(whole());
    std::vector<Surfel> block(1 << 14);
    while (const std::size_t count = source.next(block)) {
      std::vector<std::vector<Projected>> discs(1);
      for (std::size_t i = 0; i < count; ++i) project(block[i], discs[0]);
      draw(discs, executor);
    }
    finish(executor);
  }

 private:
  /// Draws discs, band by band of rows in parallel. The result depends on the order of the discs
  /// alone.
  void draw(const std::vector<std::vector<Projected>>& discs, const Executor& executor) {
    executor.for_each((height_ + kBandRows - 1) / kBandRows, [&](std::size_t band, unsigned) {
      const auto first = static_cast<unsigned>(band) * kBandRows;
      const unsigned last = std::min(height_, first + kBandRows);
      for (const auto& some : discs) {
        for (const Projected& disc : some) {
          if (disc.y0 < last && disc.y1 > first)
            cover(disc, std::max(disc.y0, first), std::min(disc.y1, last));
        }
      }
    });
  }

  /// Appends the disc of a surfel, if the picture may show it.
  void project(const Surfel& surfel, std::vector<Projected>& discs) const {
    Projected disc{
        .centre = scale_.way(position_, surfel.position) * axes_,  // v * M is transpose(M) * v
        .normal = surfel.normal * axes_,
        .radius = scale_.radius(surfel.radius),
        .payload = payload_of(surfel, 0)};
    if (!(disc.radius > 0) || disc.centre.z + disc.radius <= 0) return;
    span(disc, 0, width_, disc.x0, disc.x1);
    span(disc, 1, height_, disc.y0, disc.y1);
    if (disc.x0 >= disc.x1 || disc.y0 >= disc.y1) return;
    disc.payload.back = glm::dot(disc.normal, disc.centre) > 0;
    discs.push_back(disc);
  }

  /// Finds the samples along an axis whose centres lie within the projection of a disc: exactly
  /// these, or all samples when the disc reaches behind the camera.
  /// @param axis         0 for x, 1 for y
  /// @param size         number of samples along the axis
  /// @param first, last  get the range [first, last)
  void span(const Projected& disc, int axis, unsigned size, unsigned& first, unsigned& last) const {
    const float r2 = disc.radius * disc.radius;
    const glm::vec3& c = disc.centre;
    const glm::vec3& n = disc.normal;
    const float p = c.z * c.z - r2 * std::max(0.0F, 1 - n.z * n.z);
    first = 0;
    last = size;
    if (c.z <= 0 || p <= 1e-4F * r2) return;
    // Solve (c_a - u c_z)^2 = r^2 |k|^2 - r^2 (n.k)^2 for u, with k = (1, -u) along the axis and z
    const float across = c.z * n[axis] - c[axis] * n.z;
    const float other = n[1 - axis];
    const float square = c.z * c.z + c[axis] * c[axis] - across * across - r2 * other * other;
    const float middle = (c[axis] * c.z + r2 * n[axis] * n.z) / p;
    const float half = disc.radius * std::sqrt(std::max(0.0F, square)) / p;
    const auto end = static_cast<float>(size);
    const float low = (middle - half) * focal_ + 0.5F * end - 0.5F - 1e-3F;
    const float high = (middle + half) * focal_ + 0.5F * end + 0.5F + 1e-3F;
    first = static_cast<unsigned>(std::ceil(std::clamp(low, 0.0F, end)));
    last = static_cast<unsigned>(std::clamp(high, 0.0F, end));
  }

  /// Draws a disc into the rows [y0, y1) of samples.
  void cover(const Projected& disc, unsigned y0, unsigned y1) {
    const float height = glm::dot(disc.centre, disc.normal);
    const float square = disc.radius * disc.radius;
    for (unsigned y = y0; y < y1; ++y) {
      for (unsigned x = disc.x0; x < disc.x1; ++x) {
        const glm::vec3 along = ray(x, y);
        const float t = height / glm::dot(along, disc.normal);
        const glm::vec3 off = along * t - disc.centre;
        const float distance = glm::dot(off, off);
        if (!(t > 0 && distance < square)) continue;
        // Let the nearest centre win where coplanar discs overlap, as in the gather
        const float bumped = t + 0.01F / disc.radius * distance;
        SplatSample& sample = samples_[place_of(x, y)];
        if (bumped < sample.depth) sample = {bumped, disc.payload};
      }
    }
  }
};

}  // namespace

SplatView::SplatView(const ContainerReader& scene, const Camera& camera, unsigned side, float lift)
    : position_(camera.position),
      frame_(scene.header().frame),
      scale_(frame_),
      width_(camera.width * side),
      height_(camera.height * side),
      lift_(lift),
      sky_included_(!sky_is_gathered(scene)) {
  const CameraAxes axes = axes_of(camera);
  axes_ = glm::mat3(glm::vec3(axes.right), -glm::vec3(axes.up), glm::vec3(axes.forward));
  // Surfels that were sampled on meshes lie evenly, and cover them: what is open between them is
  // open, but for pinholes. One that stands for several is no sign of wider holes
  if (scene.meta().text.contains(kSpacingKey)) widest_ = scale_.radius(surfel_radius(scene) / 4);
  focal_ = static_cast<float>(height_) * 0.5F / std::tan(camera.vertical_fov * 0.5F);
}

void SplatView::begin(const SampleRect& area) {
  area_ = area;
  if (samples_.capacity() < area.samples()) samples_ = {};  // not both at once
  samples_.assign(area.samples(), {});
}

void SplatView::finish(const Executor& executor) {
  static_assert(sizeof(SplatSample) <= kSplatBytes);
  close_holes({.samples = samples_,
               .width = area_.x1 - area_.x0,
               .height = area_.y1 - area_.y0,
               .focal = focal_,
               .scale = scale_,
               .widest = widest_},
              executor);
}

std::optional<PrimaryHit> SplatView::at(unsigned x, unsigned y) const {
  const SplatSample& s = samples_[place_of(x, y)];
  if (s.empty()) return std::nullopt;
  const glm::vec3 along = axes_ * ray(x, y);
  const std::array<float, 3> n = decode_octahedral(s.payload.normal[0], s.payload.normal[1]);
  const std::array<float, 3> radiance = decode_rgbe(s.payload.radiance);
  glm::vec3 normal(n[0], n[1], n[2]);
  const bool back = glm::dot(normal, along) > 0;
  if (back) normal = -normal;
  const double depth = scale_.scene_units(static_cast<double>(s.depth));
  PrimaryHit hit{.position = position_ + glm::dvec3(along) * depth,
                 .normal = normal,
                 .lift = lift_height(decode_ufloat16(s.payload.radius),
                                     std::max(lift_, 0.125F * s.payload.rise), frame_),
                 .offset_normal = normal,
                 .sky_included = sky_included_ && !back,
                 .depth = static_cast<float>(depth)};
  for (int c = 0; c < 3; ++c) {
    hit.albedo[c] = static_cast<float>(s.payload.albedo[static_cast<std::size_t>(c)]) / 255;
  }
  // The radiance is that of the front; a back has only what is gathered at it
  if (!back) hit.direct = glm::vec3(radiance[0], radiance[1], radiance[2]);
  return hit;
}

SplatPayload SplatView::payload_of(const Surfel& surfel, float rise) {
  const glm::vec3 light = surfel.outgoing();
  SplatPayload payload{
      .radiance = encode_rgbe({light.r, light.g, light.b}),
      .normal = encode_octahedral({surfel.normal.x, surfel.normal.y, surfel.normal.z}),
      .radius = encode_ufloat16(surfel.radius),
      .albedo = {},
      .rise = static_cast<std::uint8_t>(8 * rise)};
  for (int c = 0; c < 3; ++c) {
    payload.albedo[static_cast<std::size_t>(c)] =
        static_cast<std::uint8_t>(std::lround(surfel.albedo[c] * 255));
  }
  return payload;
}

std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene, PointSource& surfels,
                                          const Camera& camera, unsigned side,
                                          const Executor& executor) {
  auto view = std::make_unique<DrawnView>(scene, camera, side, 0.0F);
  view->draw(surfels, executor);
  return view;
}

}  // namespace ptc
