// Lights the surfels of a container anew: the entry point of the library behind ptclight.
//
//   scene.ptcx --+-- points ---- shadow rays at its discs: suns, lamps, emitters --.
//                |               gather: sky                                       +--> target.ptcx
//                '-- channels ------------------------------------------- copied --'
//
//   ptc::LightRequest request;
//   request.scene = "dragon.ptcx";
//   request.lights = ptc::default_rig();
//   ptc::Progress silent;
//   const ptc::LightReport report = ptc::light_container(request, "lit.ptcx", silent);
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "engine/base/progress.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Lights for the surfels of a scene. Of LightingRequest, `bounces`, `error`, `estimate`, `check`
/// and `tolerate_damage` keep their defaults.
struct LightRequest : LightingRequest {
  /// Lights in place of those that lit the scene; empty: those that its container records.
  std::optional<LightRig> lights;
  LightSampling light_sampling;  ///< shadow rays of each surfel; sky_rays is not used
  bool emission = true;          ///< false: the points of the target emit nothing
  /// The open file that the target may replace, as WriterOptions::source; null: that of the scene.
  const InputFile* replaces = nullptr;
};

/// The results and the costs of lighting.
struct LightReport {
  std::uint64_t points = 0;    ///< number of points that were lit
  std::uint64_t emitters = 0;  ///< number of emitting triangles, two for each surfel that emits
  std::uint64_t rays = 0;      ///< number of shadow rays
  double ray_cpu_seconds = 0;  ///< CPU time of the shadow rays, all threads
  double sky_cpu_seconds = 0;  ///< CPU time of the gather of the sky, all threads
  GatherCounts gather;         ///< work of that gather
  CacheStatistics cache;       ///< page cache of both
  StageSeconds seconds;        ///< wall time of each stage
};

/// Writes a container with the points, the channels and the tree of a scene, whose points reflect
/// the light of other suns, lamps and skies, and of the surfels that emit, in place of what lit
/// them before (spec/shading.md#relighting). Channels of a shading, which are about the old light,
/// are left out.
///
/// A scene of clouds and meshes is built first, into a temporary container.
/// @param progress  gets the stages, and notes about the scene's record
/// @throws RequestError when a setting is out of range;
///         LimitError when the memory cap is too small: the text names the least that works;
///         DataError, FormatError for damaged input; std::system_error. A run that throws leaves
///         the target as it was
/// Memory: at most RunOptions::memory_bytes.
LightReport light_container(const LightRequest& request, const std::filesystem::path& target,
                            Progress& progress);

/// Lights the points of one part of a scene of parts by the whole scene, and writes them to a part
/// in its place, with its edges beside it. Joined, the parts have the points, the channels and the
/// tree that light_container() gives one file of the whole scene.
/// @param part  index among the parts of the scene
/// @throws as light_container()
LightReport light_part(const LightRequest& request, std::size_t part,
                       const std::filesystem::path& target, Progress& progress);

}  // namespace ptc
