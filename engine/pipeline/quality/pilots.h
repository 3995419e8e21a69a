// Pilots: receivers of a run that stand for all of them when settings are chosen.
//
//   receivers of the run   |-------|-------|-------|-------|-------|-------|-------|   blocks
//   pilots                         |=======|               |=======|                   stretches
//   candidates                      ' ' ' '                 ' ' ' '                    64 in each
//   compared with rays              '   '                     '                        8 of them
//
// A pilot knows the whole block that the run shades at once, so that its receivers get the results
// that they get in the run, whatever they share with others there. (The sky through small openings
// is looked for from what the receiver before has found, which is another one here.)
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/shade/gather/gather.h"
#include "engine/shade/shader.h"

namespace ptc {

/// A receiver of a pilot that is compared with rays.
struct Compared {
  std::size_t at = 0;  ///< its index in the block
  double weight = 1;   ///< how many receivers of the run it stands for
};

/// A stretch of neighbours in a block of a run. Some of them are compared with rays.
struct Pilot {
  static constexpr std::size_t kCandidates = 64;  ///< maximum of receivers to choose from
  static constexpr std::size_t kCompared = 8;     ///< compared ones of a pilot, in the mean

  /// Receivers that the run shades at once, along the Z-curve; not null.
  std::shared_ptr<const std::vector<Receiver>> block;
  unsigned variant = 0;            ///< variant that shades them, as for Shader::shade()
  std::size_t begin = 0, end = 0;  ///< the stretch of the block, not empty
  double weight = 1;               ///< how many receivers of the run the stretch stands for
  double phase = 0.5;              ///< where in its share of the stretch a candidate lies, 0 to 1
  std::vector<Compared> compared;

  /// Returns the number of receivers to choose from: kCandidates, or all when there are fewer.
  [[nodiscard]] std::size_t candidates() const noexcept {
    return std::min(kCandidates, end - begin);
  }
  /// Returns the index in the block of the k-th candidate. They are evenly spread.
  [[nodiscard]] std::size_t candidate_at(std::size_t k) const noexcept;
};

/// The number of pilots below which blocks are cut into stretches.
inline constexpr std::size_t kEnoughPilots = 64;

/// How many blocks of a run are pilots, and into how many stretches each is cut.
struct PilotPlan {
  std::size_t blocks = 0;     ///< 0 only for a run without receivers
  std::size_t stretches = 0;  ///< of a block: 1 where there are many blocks
};

/// Chooses the number of the pilots of a run.
/// @param receivers  number of receivers of the run
/// @param block      receivers that it shades at once, at most
[[nodiscard]] PilotPlan plan_pilots(std::uint64_t receivers, std::size_t block);

/// Cuts a block into pilots. Up to 8 receivers of each are compared, evenly spread.
/// @param block      not empty
/// @param stretches  maximum number; fewer where a stretch would be shorter than 16 receivers
/// @param share      how many receivers of the run one of the block stands for
/// @param phase      as Pilot::phase
void add_pilots(std::vector<Pilot>& pilots, std::vector<Receiver> block, unsigned variant,
                std::size_t stretches, double share, double phase = 0.5);

/// Returns the compared receivers of all pilots, in order.
[[nodiscard]] std::vector<Receiver> compared_of(std::span<const Pilot> pilots);

/// What some receivers of pilots get, pilot by pilot.
struct ShadedPilots {
  std::vector<std::vector<Shading>> results;  ///< one for each receiver, in their order
  std::vector<GatherWork> works;              ///< what they take
  std::uint64_t receivers = 0;                ///< that were shaded, those without results as well
};

/// Shades some receivers of pilots as the run does, on all threads.
/// @param cache    for ShadeOptions::readers() of each thread
/// @param options  of the run; `gather` takes the place of its settings
/// @param numbers  of the pilots
/// @param some_of  returns the receivers of a pilot: some_of(number)
/// @param turn     is added to the variants of the pilots
[[nodiscard]] ShadedPilots shade_pilots(
    const SceneView& view, PageCache& cache, const ShadeOptions& options,
    const GatherOptions& gather, std::span<const Pilot> pilots,
    std::span<const std::size_t> numbers,
    const std::function<std::span<const Compared>(std::size_t)>& some_of, const Executor& executor,
    unsigned turn = 0);

/// Returns the numbers of all pilots.
[[nodiscard]] std::vector<std::size_t> every_pilot(std::span<const Pilot> pilots);

/// A set of receivers; those at the same position count as one.
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

}  // namespace ptc
