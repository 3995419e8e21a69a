// Gives the normals of a cloud the same side everywhere.
//
// What cannot be known from a place alone is settled in three steps, each with fewer things to join
// than the one before, so that the last fits in memory:
//
//     places --links in a block--> patches --votes in a chunk--> pieces --votes--> islands
//     all                          a few for each block          a few for each    closed surfaces,
//                                                                chunk             loose parts
//
// A vote is what two neighbouring places say about their sides. All places whose side is known
// beforehand form one piece, number 0, which is never flipped. The sky votes, too, as if it were of
// that piece, if no scanner is known: on patches, for the side that is in the open where the other
// is not, and on pieces, for the side from which more of it is seen. An island without any of this
// turns outwards, or upwards where it is an open sheet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/scan/chunk_fit.h"
#include "engine/scan/known_sides.h"
#include "engine/scan/signed_graph.h"
#include "engine/scan/sky_view.h"

namespace ptc {

/// The greatest magnitude of a single vote.
inline constexpr int kFullVote = 256;
/// The maximum number of pieces of a chunk, the known one included.
inline constexpr std::size_t kMostPieces = 256;

/// One end of a link.
struct LinkEnd {
  std::array<float, 3> normal;
  float noise;  ///< lattice units
};
/// Returns the vote of two places: above 0 when their normals agree, below 0 when one of them must
/// be flipped, 0 when nothing can be said.
///
/// On a surface that turns evenly, the normal of one place is the mirror image of the other's in
/// the plane across the link: so m = a . b - 2 (e . a)(e . b) is 1 or -1, where e is the link's
/// unit vector. Where m is not near either, the places do not lie on one surface. A link along the
/// normals leads through a wall or a gap, and does not count.
/// Source: Xie, Wang, Hua, Qin and Kaufman 2003, Piecewise C1 continuous surface reconstruction of
/// noisy point clouds via local implicit quadric regression, section 3.
[[nodiscard]] std::int64_t vote_of(const LinkEnd& a, const LinkEnd& b,
                                   const std::array<float, 3>& link) noexcept;

/// Sums over the places of a piece, by which its outside is found.
struct PieceSums {
  double area = 0;                             ///< lattice units squared
  double flux = 0;                             ///< area * (normal . position)
  std::array<double, 3> normal{}, position{};  ///< times area
  std::uint64_t places = 0;
  std::int64_t sky = 0;  ///< sum of SkyView::more_in_front()

  void add(const PieceSums& other, bool flipped) noexcept;
};

/// The pieces of a chunk after its own votes.
struct ChunkPieces {
  std::vector<std::uint16_t> of;         ///< by place: its piece; 0 where the side is known
  std::vector<PieceSums> sums;           ///< by piece
  std::vector<SignedGraph::Edge> votes;  ///< between pieces, that are left
};

/// Room for the work on a chunk, which is kept for the next one.
struct OrientationRoom {
  std::vector<LinkEnd> ends;                            ///< by place
  std::vector<std::uint8_t> known;                      ///< by place: its side is known
  std::vector<float> lean;                              ///< by place: cosine to where it was seen
                                                        ///< from, or 0
  std::vector<std::int8_t> sky;                         ///< by place: more_in_front() of its normal
  std::vector<std::int8_t> open;                        ///< by place: open_side() of its normal
  std::vector<std::int64_t> patch_open;                 ///< by patch: sum of open_side()
  std::vector<std::uint32_t> patch_places;              ///< by patch: number of places
  std::vector<std::array<std::int16_t, kLinks>> votes;  ///< by place
  std::vector<std::int8_t> sign;                        ///< by place: 1 or -1
  std::vector<std::uint32_t> patch;                     ///< by place
  std::vector<std::uint32_t> number;                    ///< by root place: its patch; then by root
                                                        ///< patch: its piece
  SignedGroups groups{0};
};

/// Flips normals of a chunk so that they agree within each piece. A known normal takes the place of
/// the fitted one.
/// @param sky  null: it has no vote
/// Threads: may be called concurrently for different chunks, pieces and rooms.
void orient_chunk(ScanChunk& chunk, const KnownSides& sides, const SkyView* sky,
                  ChunkPieces& pieces, OrientationRoom& room);

}  // namespace ptc
