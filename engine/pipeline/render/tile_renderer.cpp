// A picture is rendered tile by tile. Within a tile, sample s of every pixel is shaded with variant
// s of the gather, so that the errors of a pixel's samples differ and average out. Up to 16 samples
// of all pixels are shaded in one go, for they see the same pages:
//
//   +--------+--------+--      one pixel, side = 2      for each tile, for every 16 samples
//   |  tile  |        |          +---+---+                hits of each sample in all pixels
//   | 2^16   |        |          | 0 | 1 |                shade the hits, sample s with variant s
//   +--------+--------+--        +---+---+                add results, or the sky, to the film
//   |samples |        |          | 2 | 3 |
//                                +---+---+
#include "engine/pipeline/render/tile_renderer.h"

#include <algorithm>

#include <glm/geometric.hpp>

namespace ptc {

Receiver receiver_at(const PrimaryHit& hit) {
  return {hit.position + glm::dvec3(hit.offset_normal * hit.lift), hit.normal};
}

std::array<unsigned, 2> sample_at(unsigned x, unsigned y, unsigned sample, unsigned side) {
  return {x * side + sample % side, y * side + sample / side};
}

SampleRect samples_of(const Tile& tile, unsigned side) {
  return {tile.x0 * side, tile.y0 * side, (tile.x0 + tile.width) * side,
          (tile.y0 + tile.height) * side};
}

Tile TileRenderer::tile_of(unsigned width, unsigned side) noexcept {
  constexpr unsigned kMaxVariantSide = 4, kTileSide = 256, kLeastRows = 8;
  constexpr std::uint64_t kStripPixels = std::uint64_t{1} << 19;
  static_assert(kMaxVariantSide * kMaxVariantSide == kMaxVariants);
  static_assert(kTileSide * kTileSide == kSamplesAtOnce);
  Tile tile{0, 0, kTileSide / std::min(side, kMaxVariantSide), 0};
  tile.height = tile.width;
  while (tile.height > kLeastRows && std::uint64_t{width} * tile.height > kStripPixels) {
    tile.width *= 2;
    tile.height /= 2;
  }
  return tile;
}

void TileRenderer::render_all(const FilmExtras& extras, const RowsDone& done, Progress& progress) {
  const ImageWindow& window = seen_.window;
  const unsigned samples = seen_.side * seen_.side;
  const unsigned at_once = std::min(samples, kMaxVariants);
  const Tile whole = tile_of(window.width, seen_.side);
  for (unsigned y = 0; y < window.height; y += whole.height) {
    Film film(window.width, std::min(window.height - y, whole.height), extras);
    for (unsigned x = 0; x < window.width; x += whole.width) {
      const Tile tile{window.x + x, window.y + y, std::min(window.width - x, whole.width),
                      film.height()};
      if (extras.ids) {
        objects_.begin(tile.pixels(), samples);
        materials_.begin(tile.pixels(), samples);
      }
      for (unsigned first = 0; first < samples; first += at_once)
        render(tile, first, std::min(at_once, samples - first), film, progress);
      if (extras.ids) set_ids(tile, film);
    }
    film.finish();
    done(film, y);
  }
}

/// Renders some samples of each pixel of a tile.
/// @param first  number of the first one, 0 to side^2 - 1
void TileRenderer::render(const Tile& tile, unsigned first, unsigned count, Film& film,
                          Progress& progress) {
  find_hits(tile, first, count);
  receivers_.clear();
  std::vector<std::size_t> counts(count);
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    if (!hits_[i]) continue;
    receivers_.push_back(receiver_at(*hits_[i]));
    ++counts[i / tile.pixels()];
  }
  LitReceivers lit = lighting_.shade(receivers_, counts);
  lit.shadows = find_shadows();
  expose(tile, first, lit, film);
  progress.advance(hits_.size() - receivers_.size());
}

void TileRenderer::find_hits(const Tile& tile, unsigned first, unsigned count) {
  seen_.view.look_at(samples_of(tile, seen_.side));
  hits_.assign(tile.pixels() * count, std::nullopt);
  lighting_.executor().for_each(std::size_t{tile.height} * count, [&](std::size_t i, unsigned) {
    const auto row = static_cast<unsigned>(i % tile.height),
               sample = first + static_cast<unsigned>(i / tile.height);
    for (unsigned column = 0; column < tile.width; ++column) {
      const auto [x, y] = sample_at(tile.x0 + column, tile.y0 + row, sample, seen_.side);
      hits_[i * tile.width + column] = seen_.view.at(x, y);
    }
  });
}

/// Returns the shadows at the hits, hit after hit.
std::span<const float> TileRenderer::find_shadows() {
  if (casters_.of_surfels) return casters_.of_surfels->at(receivers_);
  const auto& lights = casters_.of_mesh;
  if (lights.empty()) return {};
  std::vector<const PrimaryHit*> seen;
  for (const auto& hit : hits_) {
    if (hit) seen.push_back(&*hit);
  }
  shadows_.resize(seen.size() * lights.size());
  lighting_.executor().for_each(seen.size(), [&](std::size_t i, unsigned) {
    for (std::size_t group = 0; group < lights.size(); ++group) {
      shadows_[i * lights.size() + group] =
          lights[group]->shadow(seen[i]->surface, seen[i]->normal, sun_rays_, seed_ + i);
    }
  });
  seed_ += seen.size();
  return shadows_;
}

void TileRenderer::expose(const Tile& tile, unsigned first, const LitReceivers& lit, Film& film) {
  const unsigned side = seen_.side;
  const float weight = 1.0f / static_cast<float>(side * side);
  const float scale = 1.0f / static_cast<float>(side);
  const std::size_t groups = receivers_.empty() ? 0 : lit.shadows.size() / receivers_.size();
  const glm::dvec3 forward = axes_of(seen_.camera).forward;
  std::size_t next = 0;
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    const std::size_t place = i % tile.pixels();
    const unsigned x = tile.x0 + static_cast<unsigned>(place % tile.width);
    const unsigned y = tile.y0 + static_cast<unsigned>(place / tile.width);
    const std::size_t pixel = std::size_t{y - tile.y0} * film.width() + (x - seen_.window.x);
    const auto direction = [&] {
      const unsigned sample = first + static_cast<unsigned>(i / tile.pixels());
      const auto [sx, sy] = sample_at(x, y, sample, side);
      return seen_.camera.direction((static_cast<float>(sx) + 0.5f) * scale,
                                    (static_cast<float>(sy) + 0.5f) * scale);
    };
    if (hits_[i]) {
      if (film.has_surfaces()) {
        const glm::dvec3 along = direction();
        const double way = hits_[i]->depth / glm::dot(along, forward);
        film.add(pixel, {.depth = hits_[i]->depth,
                         .position = glm::vec3(seen_.camera.position + along * way),
                         .normal = hits_[i]->normal});
      }
      if (seen_.ids != nullptr) count_ids(place, hits_[i]->triangle);
      if (!lit.estimates.empty()) film.add(pixel, lit.estimates[next], weight);
      if (!lit.reflections.empty()) film.add(pixel, lit.reflections[next], weight);
      film.add(pixel, lit.shadows.subspan(next * groups, groups), weight);
      film.add(pixel, *hits_[i], lit.shading[next++], weight);
    } else if (seen_.sky) {
      film.add_sky(pixel, sky_.at(direction()), weight);
    }
  }
}

void TileRenderer::count_ids(std::size_t place, std::uint32_t triangle) {
  const SurfaceId id = seen_.ids->at(triangle);
  objects_.add(place, id.object);
  materials_.add(place, id.material);
}

/// Writes the numbers of a complete tile.
void TileRenderer::set_ids(const Tile& tile, Film& film) const {
  for (std::size_t place = 0; place < tile.pixels(); ++place) {
    const std::size_t x = tile.x0 - seen_.window.x + place % tile.width;
    film.set_ids(place / tile.width * film.width() + x,
                 {objects_.winner(place), materials_.winner(place)});
  }
}

}  // namespace ptc
