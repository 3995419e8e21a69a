// Flipped bits, holes, pages in the wrong place, wrong lengths, transfers as text. Each kind turns
// the number k of a way into one change:
//
//   flip_bit      bit k of the file                     swap_pages   pages k / n and k mod n of n
//   zero_sector   sector k                              copy_page    page k / n over page k mod n
//   swap_words    words k and k + 1 of 8 bytes          truncate     the first k bytes stay
//   append        1 + 97 (k / 2) bytes, 0 or 0xa5       as_text      the k-th conversion of text
#include "tools/bench/experiments/mutations.h"

#include <algorithm>

namespace ptc::bench {
namespace {

using Pages = std::span<const PagePlace>;

constexpr std::size_t kSector = 512;         // bytes
constexpr std::size_t kMaxAppended = 10000;  // bytes

auto at(Bytes& bytes, std::size_t offset) {
  return bytes.begin() + static_cast<std::ptrdiff_t>(offset);
}
auto at(const Bytes& bytes, std::size_t offset) {
  return bytes.begin() + static_cast<std::ptrdiff_t>(offset);
}

bool flip_bit(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  out = whole;
  out[k / 8] ^= std::byte{1} << (k % 8);
  return true;
}

/// Overwrites bytes with one value. @return whether that changes the file
bool fill(const Bytes& whole, std::size_t offset, std::size_t bytes, std::byte value, Bytes& out) {
  out = whole;
  std::fill_n(at(out, offset), std::min(bytes, out.size() - offset), value);
  return out != whole;
}

bool zero_sector(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  return fill(whole, k * kSector, kSector, std::byte{0}, out);
}
bool fill_sector(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  return fill(whole, k * kSector, kSector, std::byte{0xff}, out);
}
bool zero_page(const Bytes& whole, Pages pages, std::size_t k, Bytes& out) {
  return fill(whole, pages[k].offset, pages[k].bytes, std::byte{0}, out);
}

bool swap_pages(const Bytes& whole, Pages pages, std::size_t k, Bytes& out) {
  const PagePlace one = pages[k / pages.size()], other = pages[k % pages.size()];
  if (one.offset >= other.offset) return false;
  out = whole;
  const std::size_t bytes = std::min(one.bytes, other.bytes);
  std::swap_ranges(at(out, one.offset), at(out, one.offset + bytes), at(out, other.offset));
  return out != whole;
}

bool copy_page(const Bytes& whole, Pages pages, std::size_t k, Bytes& out) {
  const PagePlace from = pages[k / pages.size()], to = pages[k % pages.size()];
  out = whole;
  std::copy_n(at(whole, from.offset), std::min(from.bytes, whole.size() - to.offset),
              at(out, to.offset));
  return out != whole;
}

bool swap_words(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  out = whole;
  std::swap_ranges(at(out, 8 * k), at(out, 8 * k + 8), at(out, 8 * k + 8));
  return out != whole;
}

bool truncate(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  out.assign(whole.begin(), at(whole, k));
  return true;
}

bool append(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  out = whole;
  out.resize(whole.size() + k / 2 * 97 + 1, k % 2 == 0 ? std::byte{0} : std::byte{0xa5});
  return true;
}

bool remove_bytes(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  out = whole;
  out.erase(at(out, k * kSector), at(out, std::min(out.size(), (k + 1) * kSector)));
  return true;
}

/// Converts the file as transfers in text mode do.
bool as_text(const Bytes& whole, Pages, std::size_t k, Bytes& out) {
  constexpr std::byte kCr{'\r'}, kLf{'\n'};
  out.clear();
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const std::byte b = whole[i];
    const bool pair = b == kCr && i + 1 < whole.size() && whole[i + 1] == kLf;
    switch (k) {
      case 0:  // LF to CR LF
        if (b == kLf) out.push_back(kCr);
        out.push_back(b);
        break;
      case 1:  // CR LF to LF
        if (!pair) out.push_back(b);
        break;
      case 2:  // CR to LF
        out.push_back(b == kCr ? kLf : b);
        break;
      case 3:  // cut at the first Ctrl-Z
        if (b == std::byte{0x1a}) return true;
        out.push_back(b);
        break;
      case 4:  // the eighth bit cleared
        out.push_back(b & std::byte{0x7f});
        break;
      default:  // Latin-1 to UTF-8
        if (b >= std::byte{0x80}) out.push_back(std::byte{0xc0} | b >> 6);
        out.push_back(b >= std::byte{0x80} ? std::byte{0x80} | (b & std::byte{0x3f}) : b);
    }
  }
  return out != whole;
}

}  // namespace

std::vector<Mutation> mutations_of(const Bytes& whole, Pages pages) {
  const std::size_t sectors = whole.size() / kSector;
  return {{"each bit flipped", 8 * whole.size(), flip_bit},
          {"a sector zeroed", sectors, zero_sector},
          {"a sector of ones", sectors, fill_sector},
          {"a page zeroed", pages.size(), zero_page},
          {"two pages swapped", pages.size() * pages.size(), swap_pages},
          {"a page over another", pages.size() * pages.size(), copy_page},
          {"two words swapped", whole.size() / 8 - 1, swap_words},
          {"truncated at each byte", whole.size(), truncate},
          {"bytes appended", 2 * kMaxAppended / 97, append},
          {"a sector left out", sectors, remove_bytes},
          {"taken for text", 6, as_text}};
}

}  // namespace ptc::bench
