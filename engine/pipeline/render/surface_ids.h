// The numbers by which a picture tells the objects and materials of meshes apart.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/io/image/image.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Numbers of an object and a material; 0 where there is none.
struct SurfaceId {
  std::uint32_t object = 0;
  std::uint32_t material = 0;
};

/// Numbers the objects and materials of a mesh from 1 on, in its order. Materials of one name are
/// one, unless different files define them.
class SurfaceIds {
 public:
  /// The greatest number, up to which floats hold all whole ones. It stands for the rest, too.
  static constexpr std::uint32_t kMaxId = 1U << 24;
  /// The most objects, and the most materials, whose names text() has.
  static constexpr std::size_t kMaxNames = 65536;

  /// @param mesh  must outlive this
  explicit SurfaceIds(const Mesh& mesh);

  /// Returns the numbers of a triangle.
  /// @pre the mesh has it
  [[nodiscard]] SurfaceId at(std::uint32_t triangle) const noexcept;
  /// Returns the names by their numbers as JSON, {"1":"NAME",...}, in the attributes
  /// "ptcx/objectNames" and "ptcx/materialNames" of an .exr. Where a name occurs again, "#2", "#3"
  /// and so on follow it.
  [[nodiscard]] const ExrText& text() const noexcept { return text_; }
  /// Memory of this, bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  const Mesh* mesh_;
  std::vector<std::uint32_t> material_of_;  ///< number of each material of the mesh
  ExrText text_;
};

/// Finds the number that most samples of a pixel have.
///
/// A pixel counts up to kMaxSlots different numbers: the first ones that its samples have.
/// Memory: pixels * min(samples, kMaxSlots) * kSlotBytes.
class IdVotes {
 public:
  static constexpr unsigned kMaxSlots = 16;
  static constexpr std::uint64_t kSlotBytes = 8;

  /// Forgets all votes.
  /// @param samples  of each pixel
  void begin(std::size_t pixels, unsigned samples);
  /// Counts a sample. @param id  not 0
  void add(std::size_t pixel, std::uint32_t id);
  /// Returns the most frequent number of a pixel, of several the least; 0 without a sample.
  [[nodiscard]] std::uint32_t winner(std::size_t pixel) const;

 private:
  struct Slot {
    std::uint32_t id = 0;  ///< 0: free, and so are those behind it
    std::uint32_t count = 0;
  };
  static_assert(sizeof(Slot) == kSlotBytes);

  unsigned slots_ = 0;  ///< of each pixel
  std::vector<Slot> votes_;
};

}  // namespace ptc
