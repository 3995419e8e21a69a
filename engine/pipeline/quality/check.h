// Receivers of a run that are checked against rays afterwards.
#pragma once

#include <array>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "engine/pipeline/pipeline.h"
#include "engine/scene/mesh_reference.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Places of receivers.
class ReceiverPlaces {
 public:
  void add(const Receiver& receiver) { places_.insert(place(receiver)); }
  [[nodiscard]] bool contains(const Receiver& receiver) const {
    return places_.contains(place(receiver));
  }

 private:
  using Place = std::array<double, 3>;
  static Place place(const Receiver& r) { return {r.position.x, r.position.y, r.position.z}; }
  std::set<Place> places_;
};

/// What a receiver is off, as estimated: a root mean square, not a bound.
struct ErrorEstimate {
  float occlusion = 0;
  float irradiance = 0;  ///< W / m^2, root mean square over RGB
};

/// Keeps an even sample of a run's receivers with their shading, the same each time (reservoir
/// sampling, Vitter 1985, algorithm R).
class CheckSample {
 public:
  /// @param apart  receivers that are not to be chosen
  explicit CheckSample(const CheckRequest& request, ReceiverPlaces apart = {})
      : request_(request), apart_(std::move(apart)) {}
  /// @param estimates  as many, or none
  void add(std::span<const Receiver> receivers, std::span<const Shading> results,
           std::span<const ErrorEstimate> estimates = {});

  /// @param scene  as it was gathered from: with the bounces before the last in its surfels
  /// @param light  with the mesh under it, or null
  /// @param paths  what rays at the mesh follow
  /// @param memory_bytes  cap of what rays at the surfels need, StreamedRays::kLeastBytes at least
  /// @param progress  advances by one a receiver, twice for each reference
  [[nodiscard]] CheckReport compare(const ContainerReader& scene, Sides sides, const Sky& sky,
                                    const DirectLight* light, const RayScene* mesh,
                                    const LightPaths& paths, std::uint64_t memory_bytes,
                                    const Executor& executor, Progress& progress) const;

 private:
  CheckRequest request_;
  ReceiverPlaces apart_;
  std::uint64_t seen_ = 0;
  std::mt19937_64 bits_;  // its default seed
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::vector<ErrorEstimate> estimates_;
};

}  // namespace ptc
