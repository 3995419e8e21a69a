// Recognises the patterns that failing copies, disks and transfers leave in bytes
// (spec/recovery.md#causes). A diagnosis is evidence, not proof: two faults can look like a third.
#include "engine/verify/diagnose.h"

#include <algorithm>
#include <array>
#include <initializer_list>

#include <fmt/format.h>

#include "format/checksum.h"

namespace ptc {
namespace {

bool begins_with(std::span<const std::byte> bytes, std::initializer_list<int> pattern) {
  return bytes.size() >= pattern.size() &&
         std::equal(pattern.begin(), pattern.end(), bytes.begin(),
                    [](int a, std::byte b) { return a == std::to_integer<int>(b); });
}

bool all_zero(std::span<const std::byte> bytes) {
  return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0}; });
}

/// Finds the bit whose flip makes whole() return true, by trying every bit of `bytes`. The bytes
/// are unchanged when it returns. The search costs 8 n^2 hashed bytes for n bytes.
template <class Whole>
Diagnosis find_flipped_bit(std::span<std::byte> bytes, const Whole& whole, FlipBudget& budget) {
  if (!budget.take(8 * bytes.size() * bytes.size())) return {};
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const std::byte mask = std::byte{1} << (bit % 8);
    bytes[bit / 8] ^= mask;
    const bool found = whole();
    bytes[bit / 8] ^= mask;
    if (found)
      return {Cause::bit_flip, fmt::format("bit {} of the byte is flipped", bit % 8), bit / 8, 1,
              static_cast<unsigned>(bit % 8)};
  }
  return {};
}

/// Finds the first run of sectors that are zero. Sectors are aligned to the start of the file:
///
///   offset    |--part--|--sector--|--sector--|--part--|
///                      ^ only whole sectors are examined
Diagnosis zeroed_sectors(std::span<const std::byte> stored, std::uint64_t offset) {
  Diagnosis found;
  const auto first = static_cast<std::size_t>(round_up(offset, kSectorBytes) - offset);
  for (std::size_t at = first; at + kSectorBytes <= stored.size(); at += kSectorBytes) {
    const bool zero = all_zero(stored.subspan(at, kSectorBytes));
    if (!zero && found.bytes > 0) break;
    if (!zero) continue;
    if (found.bytes == 0) found.offset = at;
    found.bytes += kSectorBytes;
  }
  if (found.bytes == 0) return {};
  found.cause = Cause::zeroed;
  found.text = fmt::format("{} bytes are zero", found.bytes);
  return found;
}

}  // namespace

Diagnosis diagnose_magic(std::span<const std::byte> begin) {
  const auto is = [&](std::initializer_list<int> pattern) { return begins_with(begin, pattern); };
  // Recognise the magic, 89 'P' 'T' 'C' 0d 0a 1a 0a, as transfers in text mode leave it.
  if (is({0x89, 'P', 'T', 'C', 0x0a, 0x1a}))
    return {Cause::text_mode, "a transfer changed CR LF to LF"};
  if (is({0x89, 'P', 'T', 'C', 0x0d, 0x0d}) || is({0x89, 'P', 'T', 'C', 0x0d, 0x0a, 0x1a, 0x0d})) {
    return {Cause::text_mode, "a transfer changed LF to CR LF"};
  }
  if (is({0x89, 'P', 'T', 'C', 0x0d, 0x1a})) return {Cause::text_mode, "a transfer dropped LF"};
  if (is({0x89, 'P', 'T', 'C', 0x0a, 0x0a}) || is({0x89, 'P', 'T', 'C', 0x0d, 0x0d, 0x1a})) {
    return {Cause::text_mode, "a transfer changed the line ends"};
  }
  if (is({0x09, 'P', 'T', 'C'}))
    return {Cause::text_mode, "a transfer dropped the eighth bit of every byte"};
  if (is({0xc2, 0x89, 'P', 'T', 'C'}) || is({0xef, 0xbf, 0xbd, 'P', 'T', 'C'})) {
    return {Cause::text_mode, "a transfer encoded the bytes as UTF-8"};
  }
  // Recognise a file that lost its beginning, and other common formats.
  if (begin.size() < 8)
    return {Cause::truncated, fmt::format("the file has only {} bytes", begin.size())};
  if (all_zero(begin))
    return {Cause::zeroed, fmt::format("its first {} bytes are zero", begin.size()), 0,
            begin.size()};
  if (is({0x1f, 0x8b})) return {Cause::foreign, "it is a gzip file"};
  if (is({0x28, 0xb5, 0x2f, 0xfd})) return {Cause::foreign, "it is a zstd file"};
  return {Cause::foreign, ""};
}

Diagnosis diagnose_sealed(std::span<std::byte> bytes, const std::function<void()>& decodes,
                          FlipBudget& budget) {
  if (all_zero(bytes))
    return {Cause::zeroed, fmt::format("{} bytes are zero", bytes.size()), 0, bytes.size()};
  const auto whole = [&] {
    try {
      decodes();
      return true;
    } catch (const FormatError&) {
      return false;
    }
  };
  return find_flipped_bit(bytes, whole, budget);
}

Diagnosis diagnose_payload(std::span<std::byte> stored, std::uint64_t expected, bool zeros_tell,
                           std::uint64_t offset, FlipBudget& budget) {
  if (zeros_tell || all_zero(stored)) {
    Diagnosis zeroed = zeroed_sectors(stored, offset);
    if (zeroed.cause == Cause::zeroed) return zeroed;
  }
  return find_flipped_bit(
      stored, [&] { return xxh3_64(stored) == expected; }, budget);
}

void apply(const Diagnosis& diagnosis, std::uint64_t offset, Finding& finding) {
  finding.cause = diagnosis.cause;
  if (!diagnosis.text.empty()) finding.text += ": " + diagnosis.text;
  if (diagnosis.bytes == 0) return;
  finding.offset = offset + diagnosis.offset;
  finding.bytes = diagnosis.bytes;
  finding.bit = diagnosis.bit;
}

}  // namespace ptc
