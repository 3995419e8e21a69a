// The calls a user needs: scene to container, container to shaded points, container to picture.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/cache/page_cache.h"
#include "engine/io/mesh/mesh.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/build/build_space.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/shade/shading.h"
#include "engine/sort/external_sort.h"

namespace ptc {

/// What every long run is given.
struct RunOptions {
  std::uint64_t memory_bytes = std::uint64_t{2} << 30;  ///< cap on resident bytes, caches included
  unsigned threads = 0;                                 ///< 0: as many as cores
  std::vector<std::filesystem::path>
      temp_dirs;  ///< temporary files are spread over them; none: the output's directory
};

/// Seconds of wall time by stage, in the order in which they ran.
using StageSeconds = std::vector<std::pair<std::string, double>>;

struct BuildRequest {
  std::vector<std::filesystem::path> inputs;  ///< meshes and clouds
  std::shared_ptr<const Mesh> mesh;           ///< a mesh in memory, beside those of the inputs
  std::uint64_t city_points = 0;              ///< the procedural city instead of inputs
  /// A container to which the inputs are added: its points keep what they are, their order and
  /// their lights, and are not sorted again. The cube doubles until it holds all; then its points
  /// move by less than a unit of the new lattice.
  std::filesystem::path append;
  bool backdrop = false;           ///< sets the meshes on a ground before a red wall
  std::optional<LightRig> lights;  ///< of the meshes (clouds come lit); empty: a default_rig()
                                   ///< unless a mesh emits light
  SamplingOptions sampling;
  BuildOptions tree;
  std::uint8_t page_shift = 16;
  Profile profile = Profile::compact;
  /// Goes on where a build of the same request ended, however it did, and leaves what another needs
  /// to do so unless it comes to its end. Once the points are sorted, no more than
  /// `checkpoint_points` of them and what is taken at once is built again; a sort that did not come
  /// to its end begins anew. All points go to temporary files, even if memory would hold them.
  bool resume = false;
  std::uint64_t checkpoint_points = std::uint64_t{1} << 22;
  RunOptions run;
};

struct BuildReport {
  Superblock superblock;
  std::uint64_t resumed_points = 0;  ///< of an earlier build
  BuildSpace space;
  SortStatistics sort;
  StageSeconds seconds;
};

/// Samples and lights meshes, reads clouds, sorts, builds the octree and publishes the container.
/// The same request gives the same bytes for any number of threads and any cap. Notes what it takes
/// on the disk when it is known beforehand that the points go through temporary files, and refuses
/// it when there is no room.
/// @throws DataError for bad input and for what an earlier build left when it is damaged or of
/// another request,
///         std::invalid_argument as check_mesh() for the mesh in memory and for a cap that is too
///         small (the text names the least that works), std::system_error
BuildReport build_container(const BuildRequest& request, const std::filesystem::path& target,
                            Progress& progress);

/// The meshes of a request as they are sampled: one mesh, with the backdrop.
/// @param also  a mesh in memory that comes after those of the inputs, or null
/// @throws DataError, std::system_error; std::invalid_argument as check_mesh() of `also`
[[nodiscard]] Mesh load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                               bool backdrop, std::vector<MeshCamera>* cameras = nullptr);

/// A check of some receivers against rays, in the same run. Rays at the surfels keep to the memory
/// cap; those at the mesh need no more than rendering it does.
struct CheckRequest {
  unsigned receivers = 0;  ///< about so many, spread over all; 0: no check
  unsigned rays = 4096;    ///< cosine-distributed, for each receiver
};

/// Errors over the receivers of a check: root mean square and mean of (ours - rays). Noise is the
/// root mean square of what the rays themselves are off; the errors are without it.
struct CheckError {
  double occlusion_rms = 0;  ///< absolute, occlusion is 0 to 1
  double occlusion_bias = 0;
  double occlusion_mean = 0;  ///< of the rays
  double occlusion_noise = 0;
  double irradiance_rms = 0;    ///< over the mean of the rays
  double irradiance_bias = 0;   ///< likewise
  double irradiance_mean = 0;   ///< of the rays, over receivers and RGB
  double irradiance_noise = 0;  ///< over that mean

  /// What is asked for and met: the larger of both errors over their means; of occlusion alone
  /// where no light arrives.
  [[nodiscard]] double relative() const noexcept {
    return std::max(occlusion_mean > 0 ? occlusion_rms / occlusion_mean : 0.0, irradiance_rms);
  }
  /// What the rays are off, likewise.
  [[nodiscard]] double relative_noise() const noexcept {
    return std::max(occlusion_mean > 0 ? occlusion_noise / occlusion_mean : 0.0, irradiance_noise);
  }
};

/// How estimates of one quantity hold at receivers that had no part in them. The error of a single
/// one is against both halves of its rays, with what those are off; ratios are without that, and 0
/// where there is no error.
struct EstimateWorth {
  double rank = 0;          ///< correlation of the ranks of estimate and error (Spearman 1904)
  double top_tenth = 0;     ///< RMS error of the tenth with the largest estimates, over that of all
  double bottom_tenth = 0;  ///< likewise with the smallest
  double top_third = 0, bottom_third = 0;
  double rms = 0;           ///< RMS of the estimates over that of the errors
  double within_twice = 0;  ///< share of receivers whose error is at most twice the estimate
};

struct EstimateCheck {
  EstimateWorth occlusion, irradiance;
};

struct CheckReport {
  std::size_t receivers = 0;
  unsigned rays = 0;
  CheckError discs;                       ///< against rays at the same surfels
  std::optional<EstimateCheck> estimate;  ///< against the same, when there are estimates
  std::optional<CheckError> mesh;         ///< against rays at the mesh, when there is one
  double disc_microseconds = 0;           ///< CPU time of one receiver's rays at the surfels
  double mesh_microseconds = 0;
};

/// What became of an error that was asked for (spec/shading.md#error).
struct TuningReport {
  double asked = 0;          ///< share, as CheckError::relative()
  bool met = false;          ///< else the finest setting was taken, and `measured` is the floor
  GatherOptions gather;      ///< the cheapest setting that meets it
  unsigned setting = 0;      ///< its place among all, 0 the coarsest
  unsigned settings = 0;     ///< how many there are
  CheckError measured;       ///< at the pilots that did not choose it; where it is not met, at all
  std::size_t pilots = 0;    ///< receivers compared with rays
  unsigned rays = 0;         ///< for each of them
  std::uint64_t shaded = 0;  ///< receivers, over all settings that were tried
  double ray_cpu_seconds = 0;  ///< all threads, with loading the surfels
  double shade_cpu_seconds = 0;
};

/// What estimates were made of (spec/shading.md#estimate).
struct EstimateReport {
  std::size_t pilots = 0;  ///< receivers compared with rays
  double cpu_seconds =
      0;  ///< all threads: shading with another variant, and the pilots with both; without rays
};

/// A scene shaded past pages that are damaged (spec/shading.md#damage).
struct DamageReport {
  std::map<std::uint32_t, std::string>
      pages;                   ///< those that were needed and cannot be read, with what is wrong
  std::uint64_t points = 0;    ///< that lie on them: neither shaded nor seen
  std::size_t node_pages = 0;  ///< among them: what a salvage builds again
  DamageCounts stand_ins;  ///< what was drawn in place of what they hold, with a bound on the error
};

struct ShadeRequest {
  std::filesystem::path scene;  ///< surfels that occlude and emit
  std::filesystem::path
      receivers;            ///< a cloud or container to shade; empty: the scene's own points
  std::uint64_t count = 0;  ///< shade so many of the points, evenly spread in order; 0: all
  unsigned bounces = 1;  ///< of light off surfaces; each but one shades all points of the scene. 0:
                         ///< sky and occlusion alone, whatever GatherOptions::bleeding says
  GatherOptions gather;
  std::optional<double> error;  ///< chooses `gather` but for its sides: share from above 0 to 1
  bool estimate =
      false;           ///< adds what each receiver is off, as estimated; wants `error` or `check`
  float lift = 0.15F;  ///< receivers rise above their surfel by so many of its radii
  std::optional<Sky> sky;  ///< empty: the one that the scene was built with
  BackEnd back_end = BackEnd::pread;
  bool tolerate_damage =
      false;  ///< goes on past pages of the scene that break a rule; wants one bounce or none and
              ///< no rays, and a .ply where the scene's own points are shaded
  CheckRequest check;
  RunOptions run;
};

struct ShadeReport {
  std::uint64_t receivers = 0;
  unsigned bounces = 1;
  double shade_cpu_seconds = 0;   ///< of the gather alone, all threads
  double bounce_cpu_seconds = 0;  ///< likewise, of the scene's own points for the bounces before
  GatherCounts gather;
  CacheStatistics cache;
  std::optional<TuningReport> tuning;
  std::optional<EstimateReport> estimate;
  std::optional<CheckReport> check;
  std::optional<DamageReport> damage;  ///< when it was to be tolerated
  StageSeconds seconds;
};

/// Shades every receiver and writes them to `target`: .ptcx (the receivers' container with the new
/// channels occlusion, bent_normal, irradiance, sky, indirect) or .ply (the same as columns);
/// indirect = albedo / pi * (irradiance + sky). Estimates come after them: occlusion_error,
/// irradiance_error.
ShadeReport shade_container(const ShadeRequest& request, const std::filesystem::path& target,
                            Progress& progress);

/// A picture file and what it shows.
struct PictureTarget {
  std::filesystem::path path;  ///< .exr: all layers; .png: one
  std::string layer =
      "beauty";  ///< of a PNG: beauty, direct, indirect, occlusion (white: open), albedo
};

struct RenderRequest {
  std::filesystem::path scene;
  std::vector<std::filesystem::path>
      meshes;                        ///< what the camera sees; empty: the surfels themselves
  std::shared_ptr<const Mesh> mesh;  ///< a mesh in memory, beside those
  bool backdrop = false;
  std::optional<Camera> camera;  ///< empty: the mesh's or the build's, else a view of everything
  std::optional<std::array<unsigned, 2>> size;  ///< width and height in place of the camera's
  unsigned samples = 4;                         ///< per pixel, a square number
  std::optional<LightRig> lights;               ///< empty: those that the scene was built with
  /// Of the camera's pixels. Emissive triangles are surfels, so that the gather brings their light,
  /// which area rays would bring once more.
  LightSampling light_sampling{.sun_rays = 4, .area_rays = 0, .sky_rays = 0};
  unsigned bounces = 1;  ///< as of ShadeRequest
  GatherOptions gather;
  std::optional<double> error;  ///< as ShadeRequest::error
  bool estimate = false;        ///< as ShadeRequest::estimate, in layers of an .exr
  float lift = 0.15F;  ///< receivers rise by so many radii of a surfel of the scene's spacing
  float exposure = 0;  ///< stops, for PNGs of light
  BackEnd back_end = BackEnd::pread;
  bool tolerate_damage = false;  ///< as ShadeRequest::tolerate_damage
  CheckRequest check;
  RunOptions run;
};

/// Renders to .exr (beauty as RGB and the layers direct, indirect, occlusion, bent_normal, albedo,
/// alpha) and .png (one of them).
///
/// direct = emission + albedo / pi * (lights + sky), indirect = albedo / pi * irradiance from
/// surfaces, beauty = both; pixels that meet nothing show the sky. Estimates add the layers
/// occlusion_error and irradiance_error: of a pixel, the root mean square over its samples, which
/// the error of their mean is not above.
/// @param targets  one or more files, all from one rendering
ShadeReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                           Progress& progress);

}  // namespace ptc
