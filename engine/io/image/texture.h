// Pictures that are only looked up: in memory as they are stored, or in tiles on the disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/image/image.h"
#include "engine/io/image/pixel_type.h"

namespace ptc {

class ByteRange;
class RowReader;
class TextureStore;
struct PictureLimits;

/// A picture of linear RGB values that no longer changes.
/// Threads: const members may be called concurrently.
class Texture {
 public:
  /// Takes over a picture.
  /// @throws std::invalid_argument when it has another number of pixels than its size says
  Texture(Image image);  // NOLINT(google-explicit-constructor): a texture is a picture
  ~Texture();
  Texture(Texture&& other) noexcept;
  Texture& operator=(Texture&&) = delete;

  [[nodiscard]] unsigned width() const noexcept { return width_; }    ///< pixels
  [[nodiscard]] unsigned height() const noexcept { return height_; }  ///< pixels
  /// Returns the number of pixels.
  [[nodiscard]] std::uint64_t size() const noexcept { return std::uint64_t{width_} * height_; }

  /// Returns the pixel in column x of row y, counted from the top.
  /// @throws std::system_error when the temporary file cannot be read; so do the next two
  [[nodiscard]] glm::vec3 at(unsigned x, unsigned y) const;
  /// Returns `out.size()` pixels of row y from column x on.
  void read(unsigned x, unsigned y, std::span<glm::vec3> out) const;
  /// Calls `visit` with each row, from the top down.
  void visit_rows(const std::function<void(std::span<const glm::vec3>)>& visit) const;

  /// The width of a tile, pixels: read() is fastest for parts of one tile.
  static constexpr unsigned kTileWidth = 32;

  /// Returns the memory of the pixels, bytes; 0 for a texture on the disk, which its store counts.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return held_.size(); }
  /// Returns the store that holds the pixels; null for a texture in memory.
  [[nodiscard]] const TextureStore* store() const noexcept { return store_.get(); }

 private:
  friend class TextureStore;
  Texture() = default;

  unsigned width_ = 0, height_ = 0;
  PixelType type_ = PixelType::full;
  std::vector<std::byte> held_;                ///< rows of stored pixels; empty on the disk
  std::shared_ptr<const TextureStore> store_;  ///< null in memory
  std::uint64_t offset_ = 0;                   ///< of the first tile in the file of the store
};

/// Reads textures, and keeps those that would take more memory than they may in a temporary file.
///
/// Textures stay in memory, in the type that their files store, as long as all of them take at most
/// half of what they may. A quarter is a cache of tiles of later ones, which all threads share:
///
///     file   | tile 0 | tile 1 | ... of one texture | tile 0 | ... of the next |
///     tile   kTileWidth pixels of as many rows as 4 KiB hold; the last ones of a row or column are
///            as large as all
///
/// Threads: textures may be looked up concurrently, but are read one at a time.
class TextureStore : public std::enable_shared_from_this<TextureStore> {
 public:
  /// @param memory_bytes  cap on the memory of the textures, with what the decoder of a picture
  ///                      takes that cannot be decoded row by row, bytes
  /// @param directory     of the temporary file
  [[nodiscard]] static std::shared_ptr<TextureStore> make(
      std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max(),
      std::filesystem::path directory = ".");
  ~TextureStore();
  TextureStore(const TextureStore&) = delete;
  TextureStore& operator=(const TextureStore&) = delete;

  /// Reads a picture as read_image() does.
  /// @throws DataError as read_image(); LimitError when it is in a form that cannot be decoded row
  ///         by row and takes more memory than it may; std::system_error
  [[nodiscard]] Texture read(const std::filesystem::path& path,
                             std::uint64_t max_pixels = kMaxImagePixels);
  /// Reads a picture from bytes in memory or in a part of a file.
  /// @param name  name of the picture for errors; one that ends in ".tga" means a TGA
  /// @throws as read()
  [[nodiscard]] Texture read(const ByteRange& bytes, const std::string& name,
                             std::uint64_t max_pixels = kMaxImagePixels);

  /// Reads how opaque the pixels of a picture are: its alpha where that is below 1 somewhere, else,
  /// if asked for, the mean of red, green and blue as they are stored.
  /// @param grey  whether red, green and blue say it in a picture without alpha
  /// @return the share of light that each pixel stops, for R, G and B alike; nothing where all
  ///         pixels stop all of it
  /// @throws as read()
  [[nodiscard]] std::optional<Texture> read_opacity(const ByteRange& bytes, const std::string& name,
                                                    bool grey,
                                                    std::uint64_t max_pixels = kMaxImagePixels);

  /// Returns the memory of the textures and of the cache, bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return held_ + cache_bytes(); }
  /// Returns the memory of the cache of tiles, bytes; 0 as long as all textures are in memory.
  [[nodiscard]] std::uint64_t cache_bytes() const noexcept;

 private:
  friend class Texture;
  class Tiles;
  TextureStore(std::uint64_t memory_bytes, std::filesystem::path directory);

  /// Returns what the next picture may ask for.
  [[nodiscard]] PictureLimits limits(std::uint64_t max_pixels) const;
  [[nodiscard]] Texture load(RowReader& reader);

  std::uint64_t memory_bytes_;
  std::filesystem::path directory_;
  std::uint64_t held_ = 0;        ///< memory of the textures that were kept there, bytes
  std::unique_ptr<Tiles> tiles_;  ///< null as long as all textures are in memory
};

}  // namespace ptc
