#include "engine/io/image/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "engine/base/numbers.h"
#include "engine/io/file/file.h"
#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

constexpr std::size_t kTileBytes = 4096;  // or a little less
constexpr unsigned kRows = 32;            // of a texture in memory that are decoded at once

constexpr unsigned tile_rows(PixelType type) noexcept {
  return static_cast<unsigned>(kTileBytes / (Texture::kTileWidth * pixel_bytes(type)));
}

constexpr std::size_t tile_bytes(PixelType type) noexcept {
  return std::size_t{Texture::kTileWidth} * tile_rows(type) * pixel_bytes(type);
}

constexpr unsigned tiles_across(unsigned width) noexcept {
  return (width + Texture::kTileWidth - 1) / Texture::kTileWidth;
}

/// The rows of a picture as shares of 8 bits: its alpha or, of a picture of colours, their means.
class OpacityRows final : public RowReader {
 public:
  explicit OpacityRows(std::unique_ptr<RowReader> from) : from_(std::move(from)) {
    width_ = from_->width();
    height_ = from_->height();
    type_ = PixelType::share8;
  }

  void read(unsigned rows, std::span<std::byte> out) override {
    if (from_->type() == PixelType::share8) {
      from_->read(rows, out);
    } else {
      stored_.resize(out.size() * pixel_bytes(from_->type()));
      from_->read(rows, stored_);
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = mean(i);
    }
    opaque_ &= std::ranges::all_of(out, [](std::byte share) { return share == std::byte{255}; });
  }

  /// Says whether all rows so far are 1.
  [[nodiscard]] bool is_opaque() const noexcept { return opaque_; }

 private:
  /// Returns the mean of a pixel, without its curve where it is stored on one.
  [[nodiscard]] std::byte mean(std::size_t pixel) const {
    const std::size_t bytes = pixel_bytes(from_->type());
    const std::span<const std::byte> stored = std::span(stored_).subspan(pixel * bytes, bytes);
    if (from_->type() == PixelType::srgb8 || from_->type() == PixelType::srgb16) {
      const std::size_t step = bytes / 3;
      unsigned sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        std::uint16_t value = std::to_integer<std::uint16_t>(stored[c * step]);
        if (step == 2) {
          std::memcpy(&value, &stored[c * step], sizeof(value));
          value = static_cast<std::uint16_t>(value >> 8);
        }
        sum += value;
      }
      return static_cast<std::byte>((sum + 1) / 3);
    }
    glm::vec3 value;
    make_linear(from_->type(), stored, std::span(&value, 1));
    const float share = std::clamp((value.x + value.y + value.z) / 3, 0.0F, 1.0F);
    return static_cast<std::byte>(std::lround(255 * share));
  }

  std::unique_ptr<RowReader> from_;
  std::vector<std::byte> stored_;
  bool opaque_ = true;
};

}  // namespace

/// The tiles of textures on the disk, and a cache in which each tile has one place.
class TextureStore::Tiles {
 public:
  Tiles(const std::filesystem::path& directory, std::uint64_t cache_bytes)
      : file_(directory),
        slots_(static_cast<std::size_t>(std::max<std::uint64_t>(1, cache_bytes / sizeof(Slot)))) {}

  [[nodiscard]] std::uint64_t cache_bytes() const noexcept { return slots_.size() * sizeof(Slot); }

  /// Adds tiles to the file. @return their offset
  std::uint64_t append(std::span<const std::byte> tiles) {
    const std::uint64_t offset = end_;
    file_.write_at(offset, tiles);
    end_ += tiles.size();
    return offset;
  }

  /// Reads bytes of one tile.
  /// @param tile  its offset in the file
  /// @param at    offset of the bytes in the tile
  void read(std::uint64_t tile, std::size_t bytes_of_tile, std::size_t at,
            std::span<std::byte> out) {
    Slot& slot = slots_[splitmix64(tile) % slots_.size()];
    const std::lock_guard lock(slot.mutex);
    if (slot.tile != tile + 1) {
      slot.tile = 0;
      file_.read_at(tile, std::span(slot.bytes).first(bytes_of_tile));
      slot.tile = tile + 1;
    }
    std::memcpy(out.data(), slot.bytes.data() + at, out.size());
  }

 private:
  struct Slot {
    std::mutex mutex;
    std::uint64_t tile = 0;  ///< its offset + 1; 0: empty
    std::array<std::byte, kTileBytes> bytes;
  };

  TempFile file_;
  std::uint64_t end_ = 0;
  std::vector<Slot> slots_;
};

Texture::Texture(Image image) : width_(image.width), height_(image.height) {
  if (image.pixels.size() != size())
    throw std::invalid_argument("Texture: the number of pixels differs from the size");
  held_.resize(size() * pixel_bytes(type_));
  if (!held_.empty()) std::memcpy(held_.data(), image.pixels.data(), held_.size());
}

Texture::~Texture() = default;
Texture::Texture(Texture&& other) noexcept = default;

glm::vec3 Texture::at(unsigned x, unsigned y) const {
  glm::vec3 value;
  read(x, y, std::span(&value, 1));
  return value;
}

void Texture::read(unsigned x, unsigned y, std::span<glm::vec3> out) const {
  const std::size_t pixel = pixel_bytes(type_);
  if (!store_) {
    return make_linear(
        type_, std::span(held_).subspan((std::size_t{y} * width_ + x) * pixel, out.size() * pixel),
        out);
  }
  const unsigned rows = tile_rows(type_);
  const std::uint64_t first_of_row = std::uint64_t{y / rows} * tiles_across(width_);
  std::array<std::byte, kTileWidth * pixel_bytes(PixelType::full)> stored;
  while (!out.empty()) {
    const unsigned left = kTileWidth - x % kTileWidth;
    const std::size_t count = std::min<std::size_t>(left, out.size());
    const std::span<std::byte> part = std::span(stored).first(count * pixel);
    store_->tiles_->read(offset_ + (first_of_row + x / kTileWidth) * tile_bytes(type_),
                         tile_bytes(type_), ((y % rows) * kTileWidth + x % kTileWidth) * pixel,
                         part);
    make_linear(type_, part, out.first(count));
    out = out.subspan(count);
    x += static_cast<unsigned>(count);
  }
}

void Texture::visit_rows(const std::function<void(std::span<const glm::vec3>)>& visit) const {
  std::vector<glm::vec3> row(width_);
  for (unsigned y = 0; y < height_; ++y) {
    read(0, y, row);
    visit(row);
  }
}

TextureStore::TextureStore(std::uint64_t memory_bytes, std::filesystem::path directory)
    : memory_bytes_(memory_bytes), directory_(std::move(directory)) {}

TextureStore::~TextureStore() = default;

std::shared_ptr<TextureStore> TextureStore::make(std::uint64_t memory_bytes,
                                                 std::filesystem::path directory) {
  return std::shared_ptr<TextureStore>(new TextureStore(memory_bytes, std::move(directory)));
}

std::uint64_t TextureStore::cache_bytes() const noexcept {
  return tiles_ ? tiles_->cache_bytes() : 0;
}

Texture TextureStore::read(const std::filesystem::path& path, std::uint64_t max_pixels) {
  const InputFile file(path);
  return read(ByteRange(file, 0, file.size()), path.string(), max_pixels);
}

Texture TextureStore::read(const ByteRange& bytes, const std::string& name,
                           std::uint64_t max_pixels) {
  return load(*open_picture(bytes, name, limits(max_pixels)));
}

PictureLimits TextureStore::limits(std::uint64_t max_pixels) const {
  return {.max_pixels = max_pixels,
          .memory_bytes = memory_bytes_ - std::min(memory_bytes_, bytes())};
}

std::optional<Texture> TextureStore::read_opacity(const ByteRange& bytes, const std::string& name,
                                                  bool grey, std::uint64_t max_pixels) {
  for (const Channels channels : {Channels::alpha, Channels::colour}) {
    if (channels == Channels::colour && !grey) break;
    auto reader = open_picture(bytes, name, limits(max_pixels), channels);
    if (!reader) continue;
    OpacityRows rows(std::move(reader));
    Texture texture = load(rows);
    if (!rows.is_opaque()) return texture;
    held_ -= texture.bytes();
  }
  return {};
}

Texture TextureStore::load(RowReader& reader) {
  Texture texture;
  texture.width_ = reader.width();
  texture.height_ = reader.height();
  texture.type_ = reader.type();
  const std::size_t pixel = pixel_bytes(texture.type_), row_bytes = texture.width_ * pixel;
  const std::uint64_t bytes = texture.size() * pixel;

  // Keep it in memory, which grows by the rows that were decoded, as a header may lie
  if (bytes <= memory_bytes_ / 2 - std::min(held_, memory_bytes_ / 2)) {
    for (unsigned row = 0; row < texture.height_; row += kRows) {
      const unsigned rows = std::min(kRows, texture.height_ - row);
      if (texture.held_.capacity() < (row + rows) * row_bytes)
        texture.held_.reserve(std::min<std::uint64_t>(bytes, 4 * (row + rows) * row_bytes));
      texture.held_.resize((row + rows) * row_bytes);
      reader.read(rows, std::span(texture.held_).subspan(row * row_bytes));
    }
    held_ += bytes;
    return texture;
  }

  // Cut it into tiles, a row of them at a time
  if (!tiles_) tiles_ = std::make_unique<Tiles>(directory_, memory_bytes_ / 4);
  const unsigned across = tiles_across(texture.width_), height = tile_rows(texture.type_);
  std::vector<std::byte> band(height * row_bytes);
  std::vector<std::byte> tiles(across * tile_bytes(texture.type_));
  for (unsigned row = 0; row < texture.height_; row += height) {
    const unsigned rows = std::min(height, texture.height_ - row);
    reader.read(rows, std::span(band).first(rows * row_bytes));
    for (unsigned y = 0; y < rows; ++y) {
      for (unsigned tile = 0; tile < across; ++tile) {
        const std::size_t begin = std::size_t{tile} * Texture::kTileWidth * pixel;
        const std::size_t count =
            std::min(std::size_t{Texture::kTileWidth} * pixel, row_bytes - begin);
        std::memcpy(
            &tiles[tile * tile_bytes(texture.type_) + std::size_t{y} * Texture::kTileWidth * pixel],
            &band[y * row_bytes + begin], count);
      }
    }
    const std::uint64_t offset = tiles_->append(tiles);
    if (row == 0) texture.offset_ = offset;
  }
  texture.store_ = shared_from_this();
  return texture;
}

}  // namespace ptc
