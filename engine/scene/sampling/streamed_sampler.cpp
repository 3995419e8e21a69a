#include "engine/scene/sampling/streamed_sampler.h"

#include <utility>

#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/patch_sampler.h"
#include "engine/scene/sampling/patch_stream.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/surface_patches.h"

namespace ptc {
namespace {

constexpr double kPieceSurfels = 4096;
// A patch and its ray scene, and points and surfels of so many surfels
static_assert(StreamingRoom::kLeastBytes >= PieceFile::kPatchBytes + (std::uint64_t{10} << 20));
static_assert(StreamingRoom::kLeastBytes >= SpilledMesh::kBytes + PieceSortOptions::kLeastBytes);

PieceSortOptions sort_options(const StreamingRoom& room) {
  return {room.memory_bytes - SpilledMesh::kBytes, room.temp_dirs};
}

class StreamedSource final : public PatchStream {
 public:
  StreamedSource(const MeshParts& parts, const SurfaceSurvey& found, const SamplingOptions& options,
                 const StreamingRoom& room, const Executor& executor)
      : PatchStream(executor,
                    static_cast<unsigned>(room.memory_bytes / StreamingRoom::kLeastBytes)),
        field_(with_spacing(options, found.area)),
        pieces_(parts, found, field_, kPieceSurfels, sort_options(room), executor) {}

 private:
  [[nodiscard]] std::size_t patches() const override { return pieces_.size(); }

  [[nodiscard]] SampledPatch make(std::size_t index) const override {
    PieceFile::Patch patch = pieces_.load(index);
    const SurfacePatches patches(patch.mesh, field_, std::move(patch.pieces), patch.before,
                                 patch.weight);
    const SurfacePatch points = patches.spread(0, PatchSampler::kPointsPerSurfel);
    if (points.surfels == 0) return {{}, points.area, points.area};
    const RayScene rays(patch.mesh);
    return {PatchSampler(rays, nullptr, {}, false).sample(points), points.area};
  }

  SpacingField field_;
  PieceFile pieces_;
};

}  // namespace

std::unique_ptr<PointSource> sample_parts(const MeshParts& parts, const SurfaceSurvey& found,
                                          const SamplingOptions& options, const StreamingRoom& room,
                                          const Executor& executor) {
  return std::make_unique<StreamedSource>(parts, found, options, room, executor);
}

std::uint64_t streaming_bytes(const SurfaceSurvey& found, const SamplingOptions& options) noexcept {
  const double square = options.spacing * options.spacing;
  const auto surfels = static_cast<std::uint64_t>(square > 0 ? found.area / square : 0);
  constexpr std::uint64_t kPlaceBytes = 192;  // of a place in its group and its turn
  return PieceFile::index_bytes(found.triangles, surfels, kPieceSurfels) +
         kPlaceBytes * found.places();
}

}  // namespace ptc
