// Internal to the reader of PCD: decompression of LZF, the format of liblzf (Lehmann).
//
//   000LLLLL                        L + 1 bytes follow as they are
//   LLLOOOOO oooooooo               L + 2 bytes again, from 256 O + o + 1 bytes back; L is 1 to 6
//   111OOOOO llllllll oooooooo      the same with L = 7 + l
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

/// Decompresses a range of a file from front to back. A copy goes on from the place of the
/// original, so a copy that was made at some place of the decompressed data begins there.
///
/// Memory: 24 KiB for each copy.
class LzfReader {
 public:
  /// The greatest number of bytes that one compressed byte can stand for.
  static constexpr std::uint64_t kMaxRatio = 88;

  /// Begins to decompress the `bytes` bytes at `offset`, which the file has.
  /// @param file  outlives the reader and its copies
  LzfReader(const InputFile& file, std::uint64_t offset, std::uint64_t bytes)
      : file_(&file), at_(offset), end_(offset + bytes) {}

  /// Fills `out` with the next decompressed bytes.
  /// @throws DataError that names the file and the offset when the data end or break a rule
  void read(std::span<std::byte> out);
  /// Says whether all compressed bytes were used and all that they stand for was read.
  [[nodiscard]] bool at_end() const noexcept {
    return literals_ == 0 && matched_ == 0 && next_ == held_ && at_ == end_;
  }

 private:
  static constexpr std::size_t kWindowBytes = 8192;  // the greatest distance of a match
  static constexpr std::size_t kInputBytes = 16384;

  std::byte input();
  void begin_run();
  [[noreturn]] void fail(const char* rule) const;

  const InputFile* file_;
  std::uint64_t at_;   // offset of the compressed bytes behind those of held_
  std::uint64_t end_;  // of the compressed bytes
  std::array<std::byte, kInputBytes> input_{};
  std::size_t next_ = 0;  // compressed bytes [next_, held_) of input_ were not used yet
  std::size_t held_ = 0;
  std::array<std::byte, kWindowBytes> window_{};  // byte i of the data is at i modulo its size
  std::uint64_t done_ = 0;                        // bytes that were decompressed
  std::size_t literals_ = 0;                      // bytes that are left of a run ...
  std::size_t matched_ = 0;                       // ... or of a match
  std::size_t distance_ = 0;                      // of the match
};

}  // namespace ptc
