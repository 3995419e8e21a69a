// The bytes of a page as they lie in the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "format/codec.h"
#include "format/container.h"
#include "format/error.h"

namespace ptc {

/// What a page's header says of the page, apart from how it is stored.
struct PageSummary {
  PageType type = PageType::point;
  std::uint8_t group = 0;          ///< attribute pages: the channel group; else 0
  std::uint32_t rank = 0;          ///< number of pages of the same type and group before it
  std::uint8_t level = kNoLevel;   ///< node pages: the least level of their groups
  std::uint32_t record_count = 0;  ///< points, node groups, directory entries, or 1 (meta page)
  std::uint64_t first_key = 0;     ///< least high half of the keys of points or cells
  std::uint64_t last_key = 0;      ///< greatest high half of the keys of points or cells
};

/// Returns the summary that an existing page header holds.
[[nodiscard]] PageSummary summary_of(const PageHeader& page) noexcept;

/// A page as it lies in the file: header, stored payload, and zeros up to the next sector.
struct PageImage {
  PageHeader page;
  std::vector<std::byte> bytes;
};

/// Turns payloads into images of pages.
///
/// What a reader would refuse is refused with std::invalid_argument.
/// Threads: encode() may be called concurrently, each thread with its own number.
/// Memory: an encoder for each thread, up to kEncoderBytes and two pages.
class PageImages {
 public:
  static constexpr std::uint64_t kEncoderBytes = std::uint64_t{768} << 10;

  PageImages(const FileHeader& header, Codec codec, int level)
      : header_(header), codec_(codec), level_(level) {}

  /// Makes encoders for the threads numbered 0 to threads - 1.
  void prepare(unsigned threads);

  /// Compresses a payload.
  /// @param columns  of an attribute page that is to be packed; point pages are always packed
  /// @param thread   below the number that prepare() was called with
  void encode(const PageSummary& summary, std::span<const std::byte> payload,
              std::span<const PackedColumn> columns, unsigned thread, PageImage& image) const;

  /// Takes a payload that is already in its stored form.
  void take(const PageSummary& summary, Coding coding, std::uint32_t raw_bytes,
            std::span<const std::byte> stored, PageImage& image) const;

 private:
  struct Encoding {
    Encoding(Codec codec, int level) : encoder(codec, level) {}
    PageEncoder encoder;
    std::vector<std::byte> stored;
  };

  [[nodiscard]] bool fits_page(std::span<const std::byte> payload) const noexcept;

  const FileHeader& header_;
  Codec codec_;
  int level_;
  std::vector<std::unique_ptr<Encoding>> encodings_;  ///< one for each thread
};

/// Throws std::invalid_argument, which names the writer, unless `holds`.
void require_of_writer(bool holds, const char* text);

/// Runs a reader's check on what is about to be written. What fails it is the caller's mistake, and
/// becomes std::invalid_argument.
template <class Check>
void refuse_what_readers_refuse(Check&& check) {
  try {
    check();
  } catch (const FormatError& error) {
    require_of_writer(false, error.what());
  }
}

}  // namespace ptc
