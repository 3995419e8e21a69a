// The text `las.vlrs`, which keeps the records of a LAS file so that they can be written again.
//
// It is base64 (RFC 4648, section 4, padded) of records one after another as they lie in the file:
//
//   | 0 u16 | user, 16 bytes | number u16 | size u16 | description, 32 bytes | payload | next ...
//
// Extended records, whose size is a u64, follow behind a comma, as base64 of their own. The records
// about compression, of the users "laszip encoded" and "copc", are not among them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ptc {

inline constexpr const char* kLasRecordsKey = "las.vlrs";
inline constexpr std::size_t kVlrHeaderBytes = 54;
inline constexpr std::size_t kEvlrHeaderBytes = 60;  ///< of an extended record
/// Most bytes of the records of one file, with their headers, that a reader keeps.
inline constexpr std::size_t kMaxVlrs = std::size_t{1} << 20;

/// A record of the text.
struct Vlr {
  std::string user;  ///< who defined it, e.g. "LASF_Projection"
  unsigned number = 0;
  std::string bytes;  ///< header and payload
  bool extended = false;

  /// Returns what follows the header.
  [[nodiscard]] std::string_view payload() const {
    return std::string_view(bytes).substr(extended ? kEvlrHeaderBytes : kVlrHeaderBytes);
  }
};

/// A record that is not kept.
struct LostVlr {
  std::string user;
  unsigned number = 0;
  std::uint64_t bytes = 0;  ///< of the payload
};

/// Encodes records that stand one after another.
/// @param extended  the extended ones
[[nodiscard]] std::string encode_vlrs(std::span<const std::byte> records,
                                      std::span<const std::byte> extended = {});
/// Decodes the text. @return the extended records last; nothing when the text is damaged
[[nodiscard]] std::optional<std::vector<Vlr>> decode_vlrs(std::string_view text);

/// Adds notes that name the records that are left out, those of one kind together; of many kinds
/// the first few.
/// @param why  ends the sentences, e.g. "only 1 MiB of records is kept"
void note_lost_vlrs(std::span<const LostVlr> lost, const std::string& why,
                    std::vector<std::string>& notes);

/// The text with fewer records, and notes about those that it lost.
struct ShortVlrs {
  std::string text;  ///< empty when no record is kept
  std::vector<std::string> notes;
};

/// Leaves out records of the text until `most` bytes of them are left: each that does not fit
/// behind those before it. A text that is damaged is left out whole if it is too long.
/// @param why  as for note_lost_vlrs()
[[nodiscard]] ShortVlrs shorten_vlrs(const std::string& text, std::size_t most,
                                     const std::string& why);

}  // namespace ptc
