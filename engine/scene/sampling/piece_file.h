// A surface that does not fit in memory, cut into pieces that are sorted along the Z-curve on the
// disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/io/file/file.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/surface_patches.h"
#include "engine/scene/sampling/surface_survey.h"

namespace ptc {

/// What the sort of a surface may use.
struct PieceSortOptions {
  static constexpr std::uint64_t kLeastBytes = std::uint64_t{16} << 20;
  std::uint64_t memory_bytes = std::uint64_t{64} << 20;  ///< cap of the sort, at least kLeastBytes
  std::vector<std::filesystem::path> temp_dirs{"."};     ///< at least one
};

/// The pieces of meshes in a temporary file, and the patches that they make up.
///
///     triangles    -> cut_into_pieces() -> sorts by place on the curve -> one file of rows
///     rows         | path, material | positions | uvs | normals | colours |
///     patches      |----------------|--------------|--          pieces that follow one another
///     blocks       |---|---|---|---|---|---|---|---|---|        kBlockPieces each, with a box
///
/// The boxes of the blocks, and of 8 blocks, 64 blocks and so on, tell which pieces lie near a
/// patch: a surfel looks for the ends of the surface around it, also beyond its patch. Pieces that
/// lie together in a box far smaller than what a surfel covers are one rectangle there, however
/// many they are.
///
/// Memory: index_bytes().   Threads: const members may be called concurrently.
class PieceFile {
 public:
  /// Cuts and sorts the surface. The result does not depend on `options`.
  /// @param parts, field  must outlive this
  /// @param surfels       wanted in one patch, at most
  /// @throws std::system_error
  PieceFile(const MeshParts& parts, const SurfaceSurvey& found, const SpacingField& field,
            double surfels, const PieceSortOptions& options, const Executor& executor);

  /// Returns the number of patches.
  [[nodiscard]] std::size_t size() const noexcept { return begins_.size() - 1; }

  /// A patch and the surface around it.
  struct Patch {
    /// Triangles of the patch, and of what is near it if it gets a surfel. There, opaque rectangles
    /// may stand for many pieces; what is near has at most kMostNear triangles.
    Mesh mesh;
    std::vector<SurfacePatches::Piece> pieces;  ///< of the patch alone, along the curve
    double before = 0;                          ///< weight of all patches before it
    double weight = 0;                          ///< of its pieces
  };
  /// Reads a patch. @throws std::system_error
  [[nodiscard]] Patch load(std::size_t patch) const;

  /// Returns the memory of an open file of pieces, bytes.
  [[nodiscard]] static std::uint64_t index_bytes(std::uint64_t triangles, std::uint64_t surfels,
                                                 double patch_surfels) noexcept;
  /// The most memory of a patch, of what is near it and of a ray scene over them, bytes.
  static constexpr std::uint64_t kPatchBytes = std::uint64_t{16} << 20;
  static constexpr std::size_t kMostNear = std::size_t{1} << 14;

 private:
  struct Row;
  class Writer;
  /// A box in floats, relative to the origin of the parts.
  struct Box {
    glm::vec3 low{std::numeric_limits<float>::infinity()},
        high{-std::numeric_limits<float>::infinity()};
  };
  /// Pieces that follow one another.
  struct Run {
    Box box;
    glm::vec3 normal{0};  ///< sum of those of the pieces, twice as long as their areas
  };
  class LocalMesh;
  class Surroundings;

  [[nodiscard]] std::size_t groups() const noexcept;
  void sort(const SurfaceSurvey& found, const PieceSortOptions& options, const Executor& executor);
  void read_rows(std::uint64_t first, std::span<Row> rows) const;
  /// Calls move(field, bytes) for each field of a row that the file has, in the order of the file.
  template <class AnyRow, class Move>
  void move_fields(AnyRow& row, const Move& move) const;
  void pack(const Row& row, std::byte* to) const noexcept;
  void unpack(const std::byte* from, Row& row) const noexcept;
  [[nodiscard]] static Run run_of(const Row& row);
  static void merge(Run& into, const Run& other);

  const MeshParts& parts_;
  const SpacingField& field_;
  double patch_surfels_;
  std::size_t row_bytes_ = 0;
  TempFile file_;
  std::vector<std::uint64_t> begins_{0};  ///< first piece of each patch, then the end
  std::vector<double> weights_{0};        ///< weight of all patches before each, then the total
  std::vector<float> widest_, closest_;   ///< the greatest and the least spacing in each patch
  std::vector<std::vector<Run>> levels_;  ///< blocks, then kChildren of the level before, ...
};

}  // namespace ptc
