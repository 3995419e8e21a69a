// Light of more than one bounce (spec/shading.md#bounces).
//
//   bounce 1: scene ------ shade all points ------> temporary container 1
//   bounce 2: container 1  shade all points ------> temporary container 2, replaces 1
//   ...
//   last bounce: the receivers of the run look at the last container
#pragma once

#include <filesystem>
#include <memory>

#include "engine/base/memory_budget.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/light/receiver_light.h"
#include "engine/shade/shader.h"
#include "engine/store/reader.h"

namespace ptc {

/// The settings of bounce_light().
struct BounceOptions {
  unsigned bounces = 1;  ///< reflections of the light before it reaches a receiver, at most
  /// Settings for the receivers of the run. The points of the scene are shaded more coarsely, and
  /// without the sky.
  ShadeOptions shade;
  float lift = 0.15F;  ///< height of a point above its surfel, in radii of the surfel
  /// Brings the light of emitters to the points, as its first set of lights. Null: the emitters of
  /// the scene have lit them, or they gather what surfaces emit.
  ReceiverLight* emitters = nullptr;
  std::filesystem::path temp_dir;  ///< directory of the temporary containers
};

/// Charges the memory of the two temporary containers of which one is read while the next is
/// written; nothing for fewer than two bounces.
void charge_bounces(MemoryBudget& budget, const ContainerReader& scene, unsigned bounces,
                    unsigned threads);

/// Makes the container that receivers look at to see light of `bounces` bounces.
///
/// It has the points and the tree of `scene`. The radiance of a point is the radiance that it was
/// built with plus albedo / pi times its irradiance of one bounce less. Points are shaded in their
/// order, so that they need no second sort. There is one temporary container for each bounce but
/// the last, and at most two exist at once. The result depends on neither threads nor memory cap.
/// @param report  gets the wall time and the CPU time of every pass
/// @return        null for fewer than two bounces: receivers look at the scene itself
/// @throws FormatError, std::system_error
/// Memory: the cache of `shade`, what charge_bounces() charges, and buffers within kBufferBytes.
[[nodiscard]] std::unique_ptr<ContainerReader> bounce_light(const ContainerReader& scene,
                                                            const BounceOptions& options,
                                                            const Executor& executor,
                                                            LightingReport& report,
                                                            Progress& progress);

/// Makes a part of that container, with its edges beside it, for one bounce of the light: joined,
/// the parts of all that one machine makes of the whole scene (join_parts()).
/// @param scene   a scene of parts
/// @param lit     lights the points: the scene itself, or the joined parts of the bounce before
/// @param options  BounceOptions::bounces and temp_dir are not used
/// @param part    index among the parts of the scene
/// @throws as bounce_light()
/// Memory: as bounce_light(); a part is written, not the scene.
void bounce_part(const ContainerReader& scene, const ContainerReader& lit,
                 const BounceOptions& options, std::size_t part,
                 const std::filesystem::path& target, const Executor& executor,
                 LightingReport& report, Progress& progress);

}  // namespace ptc
