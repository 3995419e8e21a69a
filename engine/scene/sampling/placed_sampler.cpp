#include "engine/scene/sampling/placed_sampler.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "engine/scene/sampling/spacing_field.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 4096;  // surfels that are set into all places before the next ones
constexpr std::size_t kGrain = 1024;  // surfels that a thread sets at once
constexpr double kStepsOfDouble = 4;  // spacings are told apart by factors of 2 to the 1 / 4

/// Places of one shape that share their surfels.
struct Turn {
  const PlacementGroup* group = nullptr;
  double spacing = 0;  ///< on the mesh
  std::vector<std::uint32_t> places;
};

/// Shares out the places of a group among turns.
std::vector<Turn> turns_of(const PlacementGroup& group, const PlacedMesh& placed,
                           const SpacingField& field) {
  struct Bin {
    std::vector<std::uint32_t> places;
    double squares = 0;  ///< sum of 1 / spacing^2
  };
  const Bounds bounds = placed.mesh->bounds();
  std::map<long, Bin> bins;
  for (const std::uint32_t at : group.places) {
    const Placement& place = placed.places[at];
    const Bounds there = placed_bounds(bounds, place);
    const double spacing =
        field.at(0.5 * (there.low + there.high), 0.5 * glm::distance(there.low, there.high)) /
        size_of(place);
    Bin& bin = bins[std::lround(kStepsOfDouble * std::log2(spacing))];
    bin.places.push_back(at);
    bin.squares += 1 / (spacing * spacing);
  }
  std::vector<Turn> turns;
  for (auto& [step, bin] : bins) {
    // As many surfels as the places of the bin want together
    const double spacing = std::sqrt(static_cast<double>(bin.places.size()) / bin.squares);
    turns.push_back({&group, spacing, std::move(bin.places)});
  }
  return turns;
}

class PlacedSource final : public PointSource {
 public:
  PlacedSource(const MeshParts& parts, const SurfaceSurvey& found, const SamplingOptions& options,
               StreamingRoom room, const Executor& executor)
      : parts_(parts),
        keeps_sides_(found.keeps_sides),
        options_(with_spacing(options, found.area)),
        room_(std::move(room)),
        executor_(executor) {
    const SpacingField field(options_);
    for (const PlacementGroup& group : found.groups) {
      for (Turn& turn : turns_of(group, parts.placed()[group.mesh], field))
        turns_.push_back(std::move(turn));
    }
    options_.camera.reset();
  }

  std::size_t next(std::span<Surfel> out) override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (set_ == moves_.size() * block_.size() && !fetch()) break;
      const std::size_t count = std::min(out.size() - filled, moves_.size() * block_.size() - set_);
      executor_.for_ranges(count, kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t at = set_ + i;
          out[filled + i] = moves_[at / block_.size()].of(block_[at % block_.size()]);
        }
      });
      set_ += count;
      filled += count;
    }
    return filled;
  }

 private:
  /// Takes the next surfels of a shape. @return  false when there are none
  bool fetch() {
    for (;;) {
      if (source_) {
        block_.resize(kBlock);
        block_.resize(source_->next(block_));
        set_ = 0;
        if (!block_.empty()) return true;
        source_.reset();
        shape_.reset();
      }
      if (turn_ == turns_.size()) return false;
      begin(turns_[turn_++]);
    }
  }

  void begin(const Turn& turn) {
    const PlacedMesh& placed = parts_.placed()[turn.group->mesh];
    shape_.emplace();
    shape_->add(placed.mesh,
                turn.group->is_plain ? std::optional<Placement>() : Placement(turn.group->shape));
    constexpr std::size_t kKeys = 4096;  // places for the sort of its pieces
    const SurfaceSurvey found = survey(*shape_, kKeys, keeps_sides_);
    options_.spacing = turn.spacing;
    source_ = sample_parts(*shape_, found, options_, room_, executor_);
    moves_.clear();
    moves_.reserve(turn.places.size());
    const glm::dmat3 back = glm::inverse(turn.group->shape);
    for (const std::uint32_t at : turn.places)
      moves_.push_back(SurfelMove(Placement(glm::dmat4(placed.places[at]) * glm::dmat4(back))));
  }

  const MeshParts& parts_;
  bool keeps_sides_;
  SamplingOptions options_;
  StreamingRoom room_;
  const Executor& executor_;
  std::vector<Turn> turns_;
  std::size_t turn_ = 0;                 ///< the next one
  std::optional<MeshParts> shape_;       ///< of the turn
  std::unique_ptr<PointSource> source_;  ///< of its surfels
  std::vector<SurfelMove> moves_;        ///< to its places
  std::vector<Surfel> block_;
  std::size_t set_ = 0;  ///< surfels of the block in their places that were handed out
};

}  // namespace

SurfelMove::SurfelMove(const Placement& place)
    : linear_(place),
      shift_(place[3]),
      normals_(normal_transform(glm::dmat4(linear_))),
      size_(size_of(place)) {}

Surfel SurfelMove::of(const Surfel& surfel) const {
  Surfel moved = surfel;
  moved.position = linear_ * surfel.position + shift_;
  const glm::dvec3 normal = normals_ * glm::dvec3(surfel.normal);
  const double area = glm::length(normal);  // of what was 1
  if (area > 0) moved.normal = glm::vec3(normal / area);
  moved.radius =
      static_cast<float>(static_cast<double>(surfel.radius) * (area > 0 ? std::sqrt(area) : size_));
  return moved;
}

std::unique_ptr<PointSource> sample_placed(const MeshParts& parts, const SurfaceSurvey& found,
                                           const SamplingOptions& options,
                                           const StreamingRoom& room, const Executor& executor) {
  return std::make_unique<PlacedSource>(parts, found, options, room, executor);
}

}  // namespace ptc
