#include "engine/pipeline/build/still_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"
#include "engine/io/cloud/record.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/sampling/surroundings.h"
#include "engine/scene/step_off.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr unsigned kPlaces = 4;  // of a surfel that light is traced from, one in each quarter
constexpr double kQuarter = 0.353553391;  // of the edge of the square that a disc of radius 1 has
constexpr double kNear = 0.5;  // a place of the surface is looked for so near its disc, radii
// A ball that hides less of an even sky than half of what the radiance of a point is rounded by
// (kRoundedRadiance): seen under less than asin(kSmall)
constexpr double kSmall = 0.0442;
// Balls that hide less than 1 % and less than 25 % of an even sky: a few rays tell how much
constexpr double kFew = 0.1, kMedium = 0.5;

unsigned share(unsigned rays) {
  return (rays + kPlaces - 1) / kPlaces;
}

template <class T>
std::vector<T> cut_tail(std::vector<T>& all, std::size_t first) {
  if (all.size() <= first) return {};
  const auto at = all.begin() + static_cast<std::ptrdiff_t>(first);
  std::vector<T> tail(at, all.end());
  all.erase(at, all.end());
  return tail;
}

}  // namespace

Mesh cut_mesh(Mesh& mesh, std::uint32_t first) {
  Mesh tail;
  tail.origin = mesh.origin;
  tail.materials = mesh.materials;
  tail.triangles = cut_tail(mesh.triangles, first);
  tail.material_of = cut_tail(mesh.material_of, first);
  std::uint32_t vertex = static_cast<std::uint32_t>(mesh.positions.size());
  for (const auto& triangle : tail.triangles)
    vertex = std::min({vertex, triangle[0], triangle[1], triangle[2]});
  for (auto& triangle : tail.triangles) {
    for (std::uint32_t& corner : triangle) corner -= vertex;
  }
  tail.positions = cut_tail(mesh.positions, vertex);
  tail.normals = cut_tail(mesh.normals, vertex);
  tail.uvs = cut_tail(mesh.uvs, vertex);
  tail.colours = cut_tail(mesh.colours, vertex);
  return tail;
}

/// A place of a surfel on the mesh.
struct StillLight::Place {
  glm::dvec3 position;  // on the surface
  glm::dvec3 origin;    // of rays
  glm::vec3 normal;     // unit, of the side of the surfel
  glm::vec3 upwards;    // the same of the triangle
};

StillLight::StillLight(Mesh whole, std::uint32_t first, const LightRig& lights,
                       const LightSampling& sampling)
    : moving_mesh_(cut_mesh(whole, first)),
      still_mesh_(std::move(whole)),
      moving_(moving_mesh_),
      still_(still_mesh_),
      light_(still_, lights),
      moving_light_(moving_, LightRig{}),
      of_place_{share(sampling.sun_rays), share(sampling.area_rays), share(sampling.sky_rays)},
      lit_by_surfaces_(sampling.area_rays > 0 && still_mesh_.emits()) {
  if (const Sky& sky = light_.rig().sky; !sky.map && sampling.sky_rays > 0) {
    even_sky_ = sky.radiance;
    of_place_.sky_rays = 0;
  }
  const Bounds bounds = moving_mesh_.bounds();
  middle_ = 0.5 * (bounds.low + bounds.high);
  for (const glm::vec3& p : moving_mesh_.positions)
    radius_ = std::max(radius_, glm::distance(moving_mesh_.origin + glm::dvec3(p), middle_));
}

/// Says whether what moves may stand between a place and a lamp.
/// @param reach  radius of the ball around it, enlarged by that of the surfel
bool StillLight::may_shade_lamps(const glm::dvec3& position, double reach) const {
  const glm::dvec3 way = middle_ - position;
  const auto is_near = [&](const glm::dvec3& lamp) {
    const glm::dvec3 line = lamp - position;
    const double along =
        std::clamp(glm::dot(way, line) / std::max(glm::dot(line, line), 1e-300), 0.0, 1.0);
    return glm::distance(way, along * line) <= reach;
  };
  const LightRig& rig = light_.rig();
  for (const Sun& sun : rig.suns) {
    const double along = glm::dot(way, glm::dvec3(sun.to_sun));
    if (along < -reach) continue;
    if (sun.angular_radius > 0.7F) return true;
    const double across = std::sqrt(std::max(0.0, glm::dot(way, way) - along * along));
    const double wide = std::tan(static_cast<double>(sun.angular_radius)) * (along + reach);
    if (across <= 1.5 * (reach + wide)) return true;
  }
  return std::ranges::any_of(rig.points,
                             [&](const PointLight& l) { return is_near(l.position); }) ||
         std::ranges::any_of(rig.spots, [&](const SpotLight& l) { return is_near(l.position); });
}

/// How what moves may change the light of a surfel, by where it is alone.
StillLight::Reach StillLight::reach_of(const Surfel& surfel) const {
  const double reach = radius_ + 2 * static_cast<double>(surfel.radius);
  const glm::dvec3 way = middle_ - surfel.position;
  const double distance = glm::length(way);
  const Reach all{true, even_sky_ != glm::vec3(0), !moving_light_.is_black(), kPlaces};
  if (distance <= reach) return all;
  // Behind the surface nothing is lit or shaded, up to the tilt of a normal that is a mean
  if (glm::dot(way, glm::dvec3(surfel.normal)) < -reach - 0.1 * distance) return {};
  Reach may = all;
  may.lamps = lit_by_surfaces_ || light_.rig().sky.map || may_shade_lamps(surfel.position, reach);
  may.sky = all.sky && radius_ > kSmall * distance;
  if (!may.lamps && !may.adds && radius_ < kMedium * distance) may.places = 1;
  return may;
}

/// Finds places of the mesh below, or above, the quarters of the square cell of a surfel, or its
/// middle.
void StillLight::find_places(const Surfel& surfel, unsigned count,
                             std::vector<Place>& places) const {
  places.clear();
  const Basis basis(surfel.normal);
  const double step = count == 1 ? 0 : kQuarter * static_cast<double>(surfel.radius);
  const double near = kNear * static_cast<double>(surfel.radius);
  for (unsigned quarter = 0; quarter < count; ++quarter) {
    const glm::dvec3 beside = glm::dvec3(basis.x) * ((quarter & 1) != 0 ? step : -step) +
                              glm::dvec3(basis.y) * ((quarter & 2) != 0 ? step : -step);
    const glm::dvec3 above = surfel.position + beside + near * glm::dvec3(surfel.normal);
    const auto hit = still_.closest(above, -surfel.normal, 0, 2 * near);
    if (!hit) continue;
    const auto origin = step_off(still_, *hit, hit->front);
    if (!origin) continue;
    const float side = hit->front ? 1 : -1;
    places.push_back({hit->position, *origin, side * hit->normal, side * hit->geometric_normal});
  }
}

/// Returns the share of the light of lamps and of emitters that stand still which is left at some
/// places, and what arrives there without what moves.
StillLight::Lamps StillLight::lamps_at(std::span<const Place> places, std::uint64_t seed) const {
  std::array<std::optional<DirectLight::Shaded>, kPlaces> shaded;
  bool any = false;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place& at = places[i];
    shaded[i] = light_.shaded_by(moving_, at.position, at.origin, at.normal, of_place_, seed + i);
    any |= shaded[i].has_value();
  }
  if (!any) return {};
  DirectLight::Shaded sum;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place& at = places[i];
    if (!shaded[i]) {
      const DirectLight::Result all =
          light_.irradiance(at.position, at.origin, at.normal, of_place_, seed + i);
      shaded[i] = {all.local + all.sky, all.local + all.sky};
    }
    sum.alone += shaded[i]->alone;
    sum.beside += shaded[i]->beside;
  }
  Lamps lamps{.alone = sum.alone / static_cast<float>(places.size()), .change = true};
  for (int c = 0; c < 3; ++c) {
    if (sum.alone[c] > 0) lamps.left[c] = std::clamp(sum.beside[c] / sum.alone[c], 0.0F, 1.0F);
  }
  return lamps;
}

/// Returns the irradiance of an even sky of radiance 1 that what moves takes from a place, by rays
/// at the ball around it.
/// @param places  of its surfel that are looked at
float StillLight::taken_sky(const Place& at, std::size_t places, std::uint64_t seed) const {
  const glm::dvec3 way = middle_ - at.origin;
  const double distance = glm::length(way);
  const double sine = radius_ / distance;
  const bool inside = !(sine < 0.95);
  const double cosine = inside ? 0 : std::sqrt(1 - sine * sine);
  const Basis basis(inside ? at.normal : glm::vec3(way / distance));
  const SquarePoints points = light_points(seed, LightKind::sky);
  std::array<glm::vec3, RayScene::kRaysAtOnce> directions{};
  std::array<float, RayScene::kRaysAtOnce> brings{};
  const bool are_few = places == 1 ? sine < kFew : sine < kMedium;
  const std::size_t rays = are_few ? 4 : directions.size();
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < rays; ++i) {
    const glm::vec2 square = points.square(i);
    glm::vec3 local = cosine_direction(square);
    float density = local.z / kPi;
    if (!inside) {
      const float z = static_cast<float>(1 - square.x * (1 - cosine));
      const float across = std::sqrt(std::max(0.0F, 1 - z * z)), turn = 2 * kPi * square.y;
      local = {across * std::cos(turn), across * std::sin(turn), z};
      density = static_cast<float>(1 / (2 * kPiDouble * (1 - cosine)));
    }
    const glm::vec3 direction = basis.to_world(local);
    const float towards = glm::dot(direction, at.normal);
    if (!(towards > 0)) continue;
    directions[count] = direction;
    brings[count++] = towards / (density * static_cast<float>(rays));
  }
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const std::uint32_t meets =
      moving_.occluded(at.origin, std::span(directions).first(count), 0, kFar);
  std::size_t met = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if ((meets >> i & 1U) == 0) continue;
    directions[met] = directions[i];
    brings[met++] = brings[i];
  }
  if (met == 0) return 0;
  const std::uint32_t hidden =
      still_.occluded(at.origin, std::span(directions).first(met), 0, kFar);
  float taken = 0;
  for (std::size_t i = 0; i < met; ++i) {
    if ((hidden >> i & 1U) == 0) taken += brings[i];
  }
  return taken;
}

/// Returns the irradiance of emitters that move, at a place.
glm::vec3 StillLight::added_at(const Place& at, std::uint64_t seed) const {
  if (moving_light_.is_black()) return glm::vec3(0);
  const auto behind =
      moving_light_.shaded_by(still_, at.position, at.origin, at.normal, of_place_, seed);
  if (behind) return behind->beside;
  return moving_light_.irradiance(at.position, at.origin, at.normal, of_place_, seed).local;
}

StillLight::Fate StillLight::light(PointRecord& record, const Frame& frame,
                                   std::uint64_t number) const {
  const Surfel surfel = to_surfel(record, frame);
  if (!(surfel.radius > 0)) return Fate::same;
  const Reach may = reach_of(surfel);
  if (!may.lamps && !may.sky && !may.adds) return Fate::same;
  thread_local std::vector<Place> places;
  find_places(surfel, may.places, places);
  if (places.empty()) return Fate::same;

  // Find what is taken from the light, and what is added
  const std::uint64_t seed = kPlaces * number;
  const Lamps lamps = may.lamps ? lamps_at(places, seed) : Lamps{};
  float sky = 0;
  glm::vec3 added(0);
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (may.sky) sky += taken_sky(places[i], places.size(), seed + i);
    if (may.adds) added += added_at(places[i], seed + i);
  }
  const auto count = static_cast<float>(places.size());
  const glm::vec3 taken = even_sky_ * (sky / count);
  added /= count;

  // Leave out what is inside of what moves
  if (glm::distance(surfel.position, middle_) <= radius_ && added == glm::vec3(0)) {
    const auto is_inside = [&](const Place& at) {
      return is_buried(moving_, at.origin, at.upwards,
                       seed + static_cast<std::uint64_t>(&at - places.data()));
    };
    if (std::ranges::all_of(places, is_inside)) return Fate::buried;
  }

  // Set what is reflected. Light of lamps is all, or all but that of the sky
  if (!lamps.change && taken == glm::vec3(0) && added == glm::vec3(0)) return Fate::same;
  for (int c = 0; c < 3; ++c) {
    const float reflects = surfel.albedo[c] / kPi;
    const float of_lamps = even_sky_ == glm::vec3(0)
                               ? surfel.radiance[c]
                               : std::min(surfel.radiance[c], reflects * lamps.alone[c]);
    const float left = surfel.radiance[c] - of_lamps * (1 - lamps.left[c]) - reflects * taken[c];
    record.radiance[static_cast<std::size_t>(c)] =
        encode_half(std::max(0.0F, left) + reflects * added[c]);
  }
  return Fate::changed;
}

/// The points of what stands still, in the light of the moment.
class StillLight::Points : public PointStream {
 public:
  Points(const StillLight& light, PointStream& still, const Frame& frame, const Executor& executor)
      : light_(light), still_(still), frame_(frame), executor_(executor) {}

  std::size_t next(std::span<PointRecord> out) override {
    while (const std::size_t count = still_.next(out)) {
      fates_.resize(count);
      executor_.for_ranges(count, 1 << 8, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
          fates_[i] = light_.light(out[i], frame_, number_ + i);
      });
      number_ += count;
      std::size_t kept = 0;
      for (std::size_t i = 0; i < count; ++i) {
        if (fates_[i] != Fate::buried) out[kept++] = out[i];
      }
      if (kept > 0) return kept;
    }
    return 0;
  }

 private:
  const StillLight& light_;
  PointStream& still_;
  Frame frame_;
  const Executor& executor_;
  std::vector<Fate> fates_;
  std::uint64_t number_ = 0;  ///< of the next point
};

std::unique_ptr<PointStream> StillLight::light(PointStream& still, const Frame& frame,
                                               const Executor& executor) const {
  return std::make_unique<Points>(*this, still, frame, executor);
}

}  // namespace ptc
