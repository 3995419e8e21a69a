// Renders a picture, tile by tile, into films of some rows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/light/group_shadows.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/render/film.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/surface_ids.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// What a camera sees.
struct SeenThrough {
  const Camera& camera;
  unsigned side = 1;  ///< samples of a pixel lie on a grid of side x side
  PrimaryView& view;
  ImageWindow window;  ///< of its picture that is rendered
  bool sky = true;     ///< whether samples that meet nothing show the sky, and else stay black
  /// Numbers of the objects and materials of the mesh; null: the films have none.
  const SurfaceIds* ids = nullptr;
};

/// The shadows of groups of lights that a picture shows: those of a mesh or those of surfels, or
/// none.
struct PictureShadows {
  std::vector<std::unique_ptr<DirectLight>> of_mesh;  ///< for each group
  std::unique_ptr<DiscShadows> of_surfels;
};

/// Returns where light is received at what a sample sees.
[[nodiscard]] Receiver receiver_at(const PrimaryHit& hit);

/// Returns the place of a pixel's sample on the grid of all samples.
/// @param side  samples along the side of a pixel
[[nodiscard]] std::array<unsigned, 2> sample_at(unsigned x, unsigned y, unsigned sample,
                                                unsigned side);

/// A rectangle of pixels.
struct Tile {
  unsigned x0, y0, width, height;
  [[nodiscard]] std::size_t pixels() const { return std::size_t{width} * height; }
};

/// Returns the samples of the pixels of a tile.
/// @param side  samples along the side of a pixel
[[nodiscard]] SampleRect samples_of(const Tile& tile, unsigned side);

/// Gets the layers of complete rows of a window.
/// @param first  the first of the rows, from the top of the window
using RowsDone = std::function<void(const Film& rows, unsigned first)>;

/// Renders all samples of a picture. Each sample of a pixel is shaded with a variant of its own, so
/// that what one of them resolves too coarsely averages out over the others.
class TileRenderer {
 public:
  /// The most variants that samples are shaded with.
  static constexpr unsigned kMaxVariants = 16;
  /// The most samples that are shaded in one go.
  static constexpr std::uint64_t kSamplesAtOnce = std::uint64_t{1} << 16;

  /// Returns the size of the tiles of a picture, which does not depend on the memory cap; those at
  /// the right and lower borders are cut off there. One row of tiles is in memory at once: the
  /// wider the picture, the lower they are.
  /// @param width  of the picture, pixels
  /// @param side   samples along the side of a pixel
  [[nodiscard]] static Tile tile_of(unsigned width, unsigned side) noexcept;

  /// All but `seen` must outlive this.
  /// @param sun_rays  shadow rays of a hit on a mesh for each sun, where shadows are asked for
  /// @param lighting  tuned
  TileRenderer(const SeenThrough& seen, const PictureShadows& shadows, unsigned sun_rays,
               const Sky& sky, Lighting& lighting)
      : seen_(seen), casters_(shadows), sun_rays_(sun_rays), sky_(sky), lighting_(lighting) {}

  /// Renders all samples, one row of tiles after another.
  /// @param extras    of the films; has ids if SeenThrough has
  /// @param done      gets each row of tiles, from the top of the window down
  /// @param progress  advances by one for each sample
  /// @throws as Lighting::shade(), and what `done` throws
  void render_all(const FilmExtras& extras, const RowsDone& done, Progress& progress);

 private:
  void render(const Tile& tile, unsigned first, unsigned count, Film& film, Progress& progress);
  void find_hits(const Tile& tile, unsigned first, unsigned count);
  [[nodiscard]] std::span<const float> find_shadows();
  void expose(const Tile& tile, unsigned first, const LitReceivers& lit, Film& film);
  void count_ids(std::size_t place, std::uint32_t triangle);
  void set_ids(const Tile& tile, Film& film) const;

  SeenThrough seen_;
  const PictureShadows& casters_;
  unsigned sun_rays_;
  const Sky& sky_;
  Lighting& lighting_;
  std::vector<std::optional<PrimaryHit>> hits_;
  std::vector<Receiver> receivers_;
  std::vector<float> shadows_;
  IdVotes objects_, materials_;  ///< of the pixels of a tile
  std::uint64_t seed_ = 0;       ///< hits whose shadows were found
};

}  // namespace ptc
