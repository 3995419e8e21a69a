// The last step of orientation.h: pieces of all chunks become islands.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/scan/orientation.h"
#include "engine/scan/signed_graph.h"

namespace ptc {

/// Joins the pieces of all chunks.
class Islands {
 public:
  /// Adds the pieces of the next chunk.
  void add_chunk(const ChunkPieces& pieces);
  /// Adds votes between pieces of all chunks. Those of the same pieces are added up.
  /// @param votes  are used up
  void add_votes(std::vector<SignedGraph::Edge>& votes);
  /// Returns the number of a piece among the pieces of all chunks; 0 for the known one.
  [[nodiscard]] std::uint32_t piece(std::uint64_t chunk, std::uint16_t piece) const noexcept {
    return piece == 0 ? 0 : first_[static_cast<std::size_t>(chunk)] + piece - 1;
  }
  /// Returns the memory of the pieces and votes, with what solve() needs in addition, bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept;
  /// Decides which pieces are flipped.
  /// @param up  unit
  void solve(const std::array<float, 3>& up);
  /// Says whether the normals of a piece are flipped. @pre solve() was called
  [[nodiscard]] bool flipped(std::uint32_t piece) const noexcept { return flipped_[piece] != 0; }
  /// The number of islands without a place whose side is known. @pre solve() was called
  [[nodiscard]] std::uint64_t count() const noexcept { return islands_; }

 private:
  std::vector<std::uint32_t> first_;  ///< by chunk: number of its piece 1
  std::vector<PieceSums> sums_{1};    ///< by piece
  std::vector<SignedGraph::Edge> votes_;
  std::vector<std::uint8_t> flipped_;
  std::uint64_t islands_ = 0;
};

}  // namespace ptc
