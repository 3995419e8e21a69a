#include "engine/pipeline/build/scene_part.h"

#include <algorithm>
#include <map>
#include <span>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/base/memory.h"
#include "engine/pipeline/build/still_light.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/sampling/sampler.h"
#include "format/checksum.h"

namespace ptc {
namespace {

/// Joins the meshes of a scene, of which the moving ones follow the still ones and can be replaced.
class JoinedParts {
 public:
  explicit JoinedParts(Mesh still)
      : mesh_(std::move(still)),
        first_(static_cast<std::uint32_t>(mesh_.triangles.size())),
        material_of_(mesh_.material_of),
        materials_(mesh_.materials.size()) {}

  /// The first triangle of what moves.
  [[nodiscard]] std::uint32_t first() const noexcept { return first_; }
  /// Returns the whole with other moving meshes. What became of the sides is undone.
  /// @param whole  that this returned before; at first the still mesh
  [[nodiscard]] Mesh with(const Mesh& moving, std::optional<Mesh> whole = {}) {
    Mesh mesh = whole ? std::move(*whole) : std::move(mesh_);
    if (whole) {
      static_cast<void>(cut_mesh(mesh, first_));
      mesh.material_of = material_of_;
      mesh.materials.resize(materials_);
    }
    append_mesh(mesh, moving, glm::dmat4(1));
    check_mesh(mesh, "inputs");
    return mesh;
  }

 private:
  Mesh mesh_;
  std::uint32_t first_;
  std::vector<std::uint16_t> material_of_;
  std::size_t materials_;
};

/// Returns for each of the first triangles how many of its sides count.
std::string sides_of_first(const Mesh& mesh, std::uint32_t count) {
  std::string sides(count, '1');
  for (std::uint32_t i = 0; i < count; ++i) {
    if (mesh.materials[mesh.material_of[i]].double_sided) sides[i] = '2';
  }
  return sides;
}

/// Returns a text that changes with the shape of a mesh, as when its file is written anew.
std::string digest_of(const Mesh& mesh) {
  return fmt::format("{:016x} {:016x}", xxh3_64(std::as_bytes(std::span(mesh.positions))),
                     xxh3_64(std::as_bytes(std::span(mesh.triangles))));
}

/// The lights of a request, chosen as for a scene in one piece.
class PartLights {
 public:
  PartLights(const BuildRequest& request, const MeshLimits& limits) : request_(request) {
    const SceneObjects objects =
        read_scene_objects(request.inputs, nullptr, limits.reading, request.moment);
    if (request.lights) {
      given_ = *request.lights;
    } else if (objects.lights) {
      given_ = *objects.lights;
      const auto store = TextureStore::make(limits.textures, limits.temp_directory);
      static_cast<void>(load_sky_map(given_->sky, {}, *store));
    }
  }

  /// @param still, moving  the lights of the files
  /// @param emits          whether a surface emits
  [[nodiscard]] LightRig with(std::vector<MeshLight> still, const std::vector<MeshLight>& moving,
                              bool emits) const {
    if (given_) return *given_;
    still.insert(still.end(), moving.begin(), moving.end());
    if (!still.empty()) return rig_of(still);
    if (emits) return {};
    std::map<std::string, std::string> text;
    if (!request_.up.empty()) text[kUpKey] = request_.up;
    return default_rig(up_of(text));
  }

 private:
  const BuildRequest& request_;
  std::optional<LightRig> given_;
};

/// Returns the spacing that a scene asks for, and gives its mesh back.
double spacing_of(Mesh& mesh, const LightRig& lights, SamplingOptions sampling,
                  const Executor& executor) {
  if (!mesh.emits()) sampling.lights.area_rays = 0;
  const Solids solids = find_solids(mesh);
  LitMesh lit(std::move(mesh), solids, lights, false);
  const double area = seen_area(lit.light, lit.rays, sampling.lights, executor);
  mesh = std::move(lit.mesh);
  return with_spacing(sampling, area).spacing;
}

}  // namespace

bool may_have_parts(const BuildRequest& request) {
  return !request.backdrop && request.city_points == 0 && request.append.empty() &&
         std::ranges::none_of(object_files(request.inputs, request.run.memory_bytes), holds_points);
}

BuildInputs read_part(const BuildRequest& request, ScenePart& part, const MeshLimits& limits,
                      const Executor& executor, StageSeconds& seconds, Progress& progress) {
  const Stage stage(seconds, progress, "read", 0, "points");
  // Read both parts
  Progress silent;
  MeshChoice choice{.one_sided = request.one_sided, .moment = request.moment};
  const auto load = [&](Motion motion, MeshLimits room, Progress& told) {
    choice.part = motion;
    LoadedMeshes loaded = load_meshes(request.inputs, request.mesh.get(), choice, room, told);
    loaded.mesh.objects.clear();  // surfels do not know them
    loaded.mesh.object_runs.clear();
    return loaded;
  };
  LoadedMeshes still = load(Motion::still, limits, silent);
  if (still.parts) throw IsOneWhole("the meshes do not fit in memory");
  if (still.mesh.triangles.empty()) throw IsOneWhole("nothing stands still");
  MeshLimits rest = limits;
  rest.traced -= std::min(rest.traced, still.traced_bytes);
  rest.reading -= std::min(rest.reading, bytes_of(still.mesh));
  const bool is_still = part.motion == Motion::still;
  LoadedMeshes moving = load(Motion::moving, rest, is_still ? silent : progress);
  if (moving.parts) throw IsOneWhole("the meshes do not fit in memory");
  if (moving.mesh.triangles.empty()) throw IsOneWhole("nothing moves");

  // Choose the lights, and the spacing by the scene at rest
  const PartLights lights(request, limits);
  const bool moving_emits = moving.mesh.emits();
  const bool emits = still.mesh.emits() || moving_emits;
  const std::string still_digest = digest_of(still.mesh);
  JoinedParts parts(std::move(still.mesh));
  std::optional<Mesh> at_rest;
  if (request.sampling.spacing > 0) part.spacing = request.sampling.spacing;
  if (part.spacing == 0) {
    choice.moment.reset();
    const LoadedMeshes rested = load(Motion::moving, rest, silent);
    at_rest = parts.with(rested.mesh);
    const LightRig lights_at_rest = lights.with(still.lights, rested.lights, emits);
    part.spacing = spacing_of(*at_rest, lights_at_rest, request.sampling, executor);
    return_freed_memory();
  }
  Mesh mesh = parts.with(moving.mesh, std::move(at_rest));
  moving.mesh = {};
  BuildInputs inputs;
  inputs.lights = lights.with(still.lights, moving.lights, emits);
  inputs.keeps_dark = moving_emits;
  if (!request.up.empty()) inputs.clouds.text[kUpKey] = request.up;

  // Find the solids of the moment, and so what the still parts follow from
  const Solids solids = find_solids(mesh);
  auto lit = std::make_unique<LitMesh>(std::move(mesh), solids, inputs.lights, false);
  lit->first = parts.first();
  const std::string follows =
      fmt::format("{}\n{}\n{}\n{}", lights_record(inputs.lights), moving_emits,
                  sides_of_first(lit->mesh, parts.first()), still_digest);
  const Uuid basis = uuid_of(std::as_bytes(std::span(follows)));
  if (is_still) {
    mesh = std::move(lit->mesh);
    lit.reset();
    static_cast<void>(cut_mesh(mesh, parts.first()));
    lit = std::make_unique<LitMesh>(std::move(mesh), Solids{}, inputs.lights, false);
    part.basis = basis;
  } else if (part.basis != basis) {
    throw BasisDiffers("what stands still is lit by other lights, or has other sides");
  }
  inputs.emitters = is_still ? lit->mesh.emits() : emits;
  inputs.rays_at_emitters = inputs.emitters && request.sampling.lights.area_rays > 0;
  inputs.bounds.add(lit->mesh.bounds());
  inputs.sample = places_on(lit->mesh, lit->first);
  inputs.lit = std::move(lit);
  return_freed_memory();  // that reading the files and building the ray scene took
  return inputs;
}

}  // namespace ptc
