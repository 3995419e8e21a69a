// Loops of the neighbour search, compiled for every instruction set. All sets give the same bits:
// they only subtract, multiply, add, compare and choose, in the same order.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ptc {

/// Places of a page that stand and fall together in the search.
inline constexpr std::size_t kGroupPlaces = 16;

/// Positions of a loaded page in lattice units, one array for each axis, in groups with boxes.
struct PageView {
  const double* position[3];  ///< `groups` times kGroupPlaces numbers; infinity where no place is
  const double* low[3];       ///< of the boxes of the groups
  const double* high[3];
  std::size_t groups;  ///< a multiple of 16; boxes of groups without a place are empty
};

/// A box around a centre. Positions in it are told relative to the centre, as floats.
struct CentredBox {
  std::array<double, 3> centre;  ///< lattice units
  std::array<double, 3> half;    ///< half the extent along each axis, lattice units
};

/// Places that may be neighbours, relative to the centre of a box.
struct Candidates {
  /// Entries that are reserved beyond the last one, because vectors are written whole.
  static constexpr std::size_t kSlack = 32;

  explicit Candidates(std::size_t capacity);

  std::size_t capacity;
  std::size_t count = 0;
  std::vector<float> x, y, z;     ///< lattice units; infinity in the slack after the last
  std::vector<std::uint32_t> id;  ///< as gather_page() was told
  std::vector<float> squared;     ///< squared distances of the last query
  /// Room for the candidates of a query that are left.
  std::vector<float> near_squared;
  std::vector<std::uint32_t> near_index;
};

/// Appends the places of a page that lie in a box, rounded outwards, in their order.
/// @param first_id  id of the first place of the page; the others follow
/// @return false when the candidates have no room for them all
[[nodiscard]] bool gather_page(const PageView& page, const CentredBox& box, std::uint32_t first_id,
                               Candidates& out);

/// Finds the nearest candidates of a position. Of candidates at the same distance, the first ones
/// count as nearer.
/// @param wanted    the number of candidates to find, at least 1; all when there are fewer
/// @param guess     squared distance of the last one, if there is an idea of it; 0 otherwise
/// @param found     receives their indices in ascending order; has room for all candidates and
///                  Candidates::kSlack more
/// @param farthest  receives the greatest of their squared distances
/// @return the number of indices
[[nodiscard]] std::size_t find_nearest(Candidates& candidates, const std::array<float, 3>& position,
                                       std::size_t wanted, float guess, std::uint32_t* found,
                                       float& farthest);

}  // namespace ptc
