#include "engine/scan/orientation.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "format/instruction_sets.h"
#include "format/scalar.h"

namespace ptc {
namespace {

using Vec3 = std::array<float, 3>;

constexpr float kGrazing = 0.1F;      // cosine below which a known direction decides no side alone
constexpr float kDoubt = 0.6F;        // |m| up to which a vote says nothing
constexpr float kNoiseReach = 2;      // offsets along normals that noise explains, in its RMS
constexpr int kSafe = kFullVote / 2;  // of a single vote, to join places in a block
constexpr double kSheet = 0.3;        // cells across which the places of a sheet may lie
constexpr double kNoisySheet = 0.7;   // the same where they are noisy
constexpr std::int64_t kOpenShare = 4;  // of so many places of a patch, one must see the open air
constexpr std::int64_t kOpenVote = kFullVote / 4;  // of a place that sees it
constexpr std::int64_t kFirm = 6 * kFullVote;      // of the sum between patches, to join in a chunk

float dot(const Vec3& a, const Vec3& b) noexcept {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void flip(Vec3& v) noexcept {
  for (float& x : v) x = -x;
}

/// Moves a number towards 0 by what noise may explain.
float less_noise(float x, float noise) noexcept {
  return std::max(x - noise, 0.0F) + std::min(x + noise, 0.0F);
}

/// Returns the vote of two places; see vote_of(). It has no branches, so that a loop over several
/// links becomes one over vectors.
int plain_vote(float ax, float ay, float az, float a_noise, float bx, float by, float bz,
               float b_noise, float x, float y, float z) noexcept {
  const float squared = std::max(x * x + y * y + z * z, 1e-30F);
  const float noise = kNoiseReach / 2 * (a_noise + b_noise);
  const float along_a = less_noise(x * ax + y * ay + z * az, noise);
  const float along_b = less_noise(x * bx + y * by + z * bz, noise);
  const float both = along_a * along_b / squared, cosine = ax * bx + ay * by + az * bz;
  const float mirrored = cosine - 2 * both;
  const float sure = std::min(1.0F, (std::abs(mirrored) - kDoubt) * (1 / (1 - kDoubt)));
  const float vote = std::max(0.0F, sure) * kFullVote;
  const float sign = mirrored < 0 ? -1.0F : 1.0F;
  const float through = std::abs(both) > 0.5F && std::abs(cosine) > 0.7F ? 0.0F : 1.0F;
  const float apart = squared > 1e-30F ? 1.0F : 0.0F;
  return static_cast<int>(vote * sign * through * apart);
}

/// The other ends of the links of a place.
struct LinkLanes {
  float nx[kLinks], ny[kLinks], nz[kLinks], noise[kLinks], x[kLinks], y[kLinks], z[kLinks];
};

/// The work on one chunk. Votes are computed once, for the normals as they were fitted; signs tell
/// which of these are flipped in the meantime.
class ChunkOrientation {
 public:
  ChunkOrientation(ScanChunk& chunk, const SkyView* sky, ChunkPieces& pieces, OrientationRoom& room)
      : chunk_(chunk),
        sky_(sky),
        pieces_(pieces),
        count_(static_cast<std::uint32_t>(chunk.places.size())),
        room_(room) {}

  void run(const KnownSides& sides) {
    pieces_.of.assign(count_, 0);
    pieces_.votes.clear();
    set_known(sides);
    room_.sky.assign(count_, 0);
    room_.open.assign(count_, 0);
    if (std::ranges::find(room_.known, 0) != room_.known.end()) {
      room_.sign.assign(count_, 1);
      if (sky_ != nullptr) look_at_sky();
      count_votes();
      join_patches();
      join_pieces();
      flip_single();
      for (std::uint32_t i = 0; i < count_; ++i) {
        if (room_.sign[i] > 0) continue;
        flip(chunk_.fits[i].normal);
        room_.sky[i] = static_cast<std::int8_t>(-room_.sky[i]);
      }
    }
    add_up();
  }

 private:
  /// Turns the normals whose side is known.
  void set_known(const KnownSides& sides) {
    room_.known.assign(count_, 1);
    room_.lean.assign(count_, 0);
    for (std::size_t i = 0; i < count_; ++i) {
      const Place& place = chunk_.places[i];
      Vec3& normal = chunk_.fits[i].normal;
      if (place.unknown_normal == 0) {
        const auto uv = std::bit_cast<std::array<std::int16_t, 2>>(place.normal);
        normal = decode_octahedral(uv[0], uv[1]);
        continue;
      }
      const auto towards = sides.towards(place, chunk_.positions[i]);
      if (chunk_.fits[i].count < kPlaneNeighbours) {
        normal = towards.value_or(sides.up());
        continue;
      }
      const float cosine = towards ? dot(normal, *towards) : 0;
      if (cosine < 0) flip(normal);
      room_.lean[i] = std::abs(cosine);
      room_.known[i] = room_.lean[i] >= kGrazing ? 1 : 0;
    }
  }

  /// Looks at the sky from both sides of the places whose side is unknown.
  void look_at_sky() {
    const auto set_sky = [this](std::uint32_t i) {
      room_.sky[i] =
          static_cast<std::int8_t>(sky_->more_in_front(chunk_.positions[i], chunk_.fits[i].normal));
    };
    const auto set_open = [this](std::uint32_t i) {
      room_.open[i] =
          static_cast<std::int8_t>(sky_->open_side(chunk_.positions[i], chunk_.fits[i].normal));
    };
    if (sky_->cells().bits() == sky_->fine_cells().bits()) {  // the same cells: one pass does both
      for_each_in_sheets(sky_->cells(), [&](std::uint32_t i) {
        set_sky(i);
        set_open(i);
      });
    } else {
      for_each_in_sheets(sky_->cells(), set_sky);
      for_each_in_sheets(sky_->fine_cells(), set_open);
    }
  }

  /// Calls visit(place) for the places whose side is unknown and that lie in cells whose places are
  /// one sheet.
  template <class Visit>
  void for_each_in_sheets(const FullCells& cells, const Visit& visit) const {
    for (std::uint32_t i = 0, end = 0; i < count_; i = end) {
      const std::size_t cell = cells.cell_of(chunk_.positions[i]);
      for (end = i + 1; end < count_ && cells.cell_of(chunk_.positions[end]) == cell;) ++end;
      if (!is_sheet(i, end, cells.width())) continue;
      for (std::uint32_t k = i; k < end; ++k) {
        if (room_.known[k] == 0) visit(k);
      }
    }
  }

  /// Says whether places of a cell lie on one surface, as far as noise lets it be known.
  [[nodiscard]] bool is_sheet(std::uint32_t begin, std::uint32_t end, double width) const {
    const Vec3& normal = chunk_.fits[begin].normal;
    const LatticePosition& from = chunk_.positions[begin];
    double low = 0, high = 0, noise = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      double along = 0;
      for (std::size_t k = 0; k < 3; ++k)
        along += (chunk_.positions[i][k] - from[k]) * double{normal[k]};
      low = std::min(low, along);
      high = std::max(high, along);
      noise = std::max(noise, double{chunk_.fits[i].noise});
    }
    return high - low < std::min(kSheet * width + 4 * noise, kNoisySheet * width);
  }

  /// Returns the normal of a place that votes. That of the surface through all neighbours leads
  /// around an edge, where faces that meet there say little of each other's sides.
  Vec3 voting_normal(std::uint32_t i) const {
    const PlaceFit& fit = chunk_.fits[i];
    if (room_.known[i] != 0) return fit.normal;
    Vec3 normal = fit.broad;
    if (dot(normal, fit.normal) < 0) flip(normal);
    return normal;
  }

  /// Computes the votes of all links of which one end at least is unknown.
  void count_votes() {
    std::vector<LinkEnd>& ends = room_.ends;
    ends.resize(count_);
    for (std::uint32_t i = 0; i < count_; ++i) ends[i] = {voting_normal(i), chunk_.fits[i].noise};
    room_.votes.assign(count_, {});
    with_instructions(widest_instructions(), [this, &ends] {
      for (std::uint32_t i = 0; i < count_; ++i) {
        LinkLanes lanes{};
        const LatticePosition& p = chunk_.positions[i];
        for (std::size_t link = 0; link < kLinks; ++link) {
          const std::uint32_t j = chunk_.links[i][link];
          if (j == kNoLink || (room_.known[i] != 0 && room_.known[j] != 0)) continue;
          const LinkEnd& end = ends[j];
          const LatticePosition& q = chunk_.positions[j];
          lanes.nx[link] = end.normal[0];
          lanes.ny[link] = end.normal[1];
          lanes.nz[link] = end.normal[2];
          lanes.noise[link] = end.noise;
          lanes.x[link] = static_cast<float>(q[0] - p[0]);
          lanes.y[link] = static_cast<float>(q[1] - p[1]);
          lanes.z[link] = static_cast<float>(q[2] - p[2]);
        }
        const LinkEnd own = ends[i];
        std::int16_t* votes = room_.votes[i].data();
        for (std::size_t k = 0; k < kLinks; ++k) {
          votes[k] = static_cast<std::int16_t>(plain_vote(
              own.normal[0], own.normal[1], own.normal[2], own.noise, lanes.nx[k], lanes.ny[k],
              lanes.nz[k], lanes.noise[k], lanes.x[k], lanes.y[k], lanes.z[k]));
        }
      }
    });
  }

  /// Joins the places of each block to patches, along links that are safe. Patch 0 is the known
  /// one.
  void join_patches() {
    SignedGroups& groups = room_.groups;
    groups.reset(count_);
    for (const PlaceBlock& block : chunk_.blocks) {
      for (std::uint32_t i = block.begin; i < block.end; ++i) {
        if (room_.known[i] != 0) continue;
        for (std::size_t link = 0; link < kLinks; ++link) {
          const std::uint32_t j = chunk_.links[i][link];
          const int vote = room_.votes[i][link];
          if (std::abs(vote) < kSafe || j < block.begin || j >= block.end || room_.known[j] != 0)
            continue;
          groups.join(i, j, vote < 0);
        }
      }
    }
    room_.patch.assign(count_, 0);
    std::vector<std::uint32_t>& number = room_.number;
    number.assign(count_, 0);
    patches_ = 1;
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (room_.known[i] != 0) continue;
      const SignedGroups::Group group = groups.find(i);
      if (number[group.root] == 0) number[group.root] = patches_++;
      room_.patch[i] = number[group.root];
      if (group.flipped) room_.sign[i] = -1;
    }
  }

  /// Joins patches to pieces by the votes between them.
  void join_pieces() {
    // Add up the votes.
    SignedGraph graph(patches_);
    for (std::uint32_t i = 0; i < count_; ++i) {
      for (std::size_t link = 0; link < kLinks; ++link) {
        const std::uint32_t j = chunk_.links[i][link];
        if (room_.votes[i][link] != 0 && room_.patch[i] != room_.patch[j])
          graph.add(room_.patch[i], room_.patch[j],
                    room_.votes[i][link] * room_.sign[i] * room_.sign[j]);
      }
      if (room_.known[i] == 0 && room_.lean[i] > 0)
        graph.add(0, room_.patch[i], static_cast<int>(room_.lean[i] * kFullVote) * room_.sign[i]);
    }
    let_open_air_vote(graph);
    // Contract what is firm, or everything when too many pieces would be left.
    graph.contract(kFirm);
    if (number_pieces(graph) > kMostPieces) {
      graph.contract(1);
      number_pieces(graph);
    }
    // Flip so that the known piece stays as it is.
    const SignedGraph::Group known = graph.find(0);
    for (std::uint32_t i = 0; i < count_; ++i) {
      const SignedGraph::Group group = graph.find(room_.patch[i]);
      const bool turned = known.flipped && group.root == known.root;
      if (group.flipped != turned) room_.sign[i] = static_cast<std::int8_t>(-room_.sign[i]);
      pieces_.of[i] = static_cast<std::uint16_t>(room_.number[group.root]);
    }
    for (const SignedGraph::Edge& edge : graph.edges()) {
      const bool turned = known.flipped && (edge.a == known.root || edge.b == known.root);
      pieces_.votes.push_back(
          {room_.number[edge.a], room_.number[edge.b], turned ? -edge.vote : edge.vote});
    }
  }

  /// Lets the open air vote on the patches of which enough places have the same side in it.
  void let_open_air_vote(SignedGraph& graph) {
    std::vector<std::int64_t>& open = room_.patch_open;
    std::vector<std::uint32_t>& places = room_.patch_places;
    open.assign(patches_, 0);
    places.assign(patches_, 0);
    for (std::uint32_t i = 0; i < count_; ++i) {
      open[room_.patch[i]] += room_.open[i] * room_.sign[i];
      ++places[room_.patch[i]];
    }
    for (std::uint32_t patch = 1; patch < patches_; ++patch) {
      if (kOpenShare * std::abs(open[patch]) >= places[patch])
        graph.add(0, patch, open[patch] * kOpenVote);
    }
  }

  /// Numbers the groups of patches in the order of their first patch. Those past the maximum share
  /// the last number. @return the number of groups
  std::size_t number_pieces(SignedGraph& graph) {
    room_.number.assign(patches_, kNoLink);
    std::uint32_t next = 0;
    for (std::uint32_t patch = 0; patch < patches_; ++patch) {
      std::uint32_t& number = room_.number[graph.find(patch).root];
      if (number == kNoLink) number = std::min<std::uint32_t>(next++, kMostPieces - 1);
    }
    return next;
  }

  /// Flips places that most of their neighbours in the piece vote against.
  void flip_single() {
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (room_.known[i] != 0) continue;
      int sum = 0;
      for (std::size_t link = 0; link < kLinks; ++link) {
        const std::uint32_t j = chunk_.links[i][link];
        if (room_.votes[i][link] != 0 && pieces_.of[i] == pieces_.of[j])
          sum += room_.votes[i][link] * room_.sign[j];
      }
      if (sum * room_.sign[i] < 0) room_.sign[i] = static_cast<std::int8_t>(-room_.sign[i]);
    }
  }

  void add_up() {
    const std::uint16_t last = *std::ranges::max_element(pieces_.of);
    pieces_.sums.assign(last + std::size_t{1}, {});
    for (std::size_t i = 0; i < count_; ++i) {
      const PlaceFit& fit = chunk_.fits[i];
      const LatticePosition& p = chunk_.positions[i];
      const double area = static_cast<double>(fit.reach) * static_cast<double>(fit.reach);
      PieceSums& sums = pieces_.sums[pieces_.of[i]];
      sums.area += area;
      ++sums.places;
      sums.sky += room_.sky[i];
      for (std::size_t k = 0; k < 3; ++k) {
        const double along = area * static_cast<double>(fit.normal[k]);
        sums.normal[k] += along;
        sums.position[k] += area * p[k];
        sums.flux += along * p[k];
      }
    }
  }

  ScanChunk& chunk_;
  const SkyView* sky_;
  ChunkPieces& pieces_;
  std::uint32_t count_;
  OrientationRoom& room_;
  std::uint32_t patches_ = 0;
};

}  // namespace

std::int64_t vote_of(const LinkEnd& a, const LinkEnd& b,
                     const std::array<float, 3>& link) noexcept {
  return plain_vote(a.normal[0], a.normal[1], a.normal[2], a.noise, b.normal[0], b.normal[1],
                    b.normal[2], b.noise, link[0], link[1], link[2]);
}

void PieceSums::add(const PieceSums& other, bool flipped) noexcept {
  const double sign = flipped ? -1 : 1;
  area += other.area;
  flux += sign * other.flux;
  for (std::size_t k = 0; k < 3; ++k) {
    normal[k] += sign * other.normal[k];
    position[k] += other.position[k];
  }
  places += other.places;
  sky += flipped ? -other.sky : other.sky;
}

void orient_chunk(ScanChunk& chunk, const KnownSides& sides, const SkyView* sky,
                  ChunkPieces& pieces, OrientationRoom& room) {
  ChunkOrientation(chunk, sky, pieces, room).run(sides);
}

}  // namespace ptc
