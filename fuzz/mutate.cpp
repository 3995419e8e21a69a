// The mutator of containers for libFuzzer.
//
// Random bytes hardly ever pass a checksum, so a plain mutator would test nothing but checksums.
// This one knows the structures of a container:
//
//   find_layout()  --> change 1 to 3 fields, records or lengths  --> seal()
//   file header, superblocks, page headers, entries, payloads        repairs all checksums,
//   (decoded, changed and encoded again when compressed)             seven times in eight
//
// Half the time it starts from a good vector in place of the given file, because most files of a
// corpus are refused, and rules behind the refusal would not be reached.
#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <random>

#include <zstd.h>

#include "format/bytes.h"
#include "format/codec.h"
#include "format/error.h"
#include "fuzz/seal.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace ptc::fuzz {
namespace {

// A number inside a structure: its offset and its length, 1 to 8 bytes.
struct Field {
  std::size_t at;
  std::size_t bytes;
};

constexpr std::array<Field, 16> kHeaderFields{{{0, 8},
                                               {8, 2},
                                               {10, 2},
                                               {12, 4},
                                               {16, 8},
                                               {24, 8},
                                               {32, 8},
                                               {40, 8},
                                               {56, 1},
                                               {57, 1},
                                               {58, 2},
                                               {60, 4},
                                               {64, 8},
                                               {88, 8},
                                               {96, 1},
                                               {97, 8}}};
constexpr std::array<Field, 14> kPageFields{{{0, 4},
                                             {4, 1},
                                             {5, 1},
                                             {6, 1},
                                             {7, 1},
                                             {8, 4},
                                             {12, 4},
                                             {16, 4},
                                             {20, 4},
                                             {24, 1},
                                             {25, 7},
                                             {32, 8},
                                             {40, 8},
                                             {48, 8}}};
constexpr std::array<Field, 10> kEntryFields{
    {{0, 8}, {8, 4}, {12, 4}, {16, 8}, {24, 8}, {32, 4}, {36, 1}, {37, 1}, {38, 1}, {39, 1}}};
// Offsets in a page header of the fields of kEntryFields.
constexpr std::array<std::size_t, 10> kRepeats{0, 12, 16, 48, 32, 20, 4, 5, 24, 25};
constexpr std::array<Field, 41> kSuperFields{
    {{0, 8},   {8, 8},   {56, 1},  {96, 1},   {120, 8}, {128, 4}, {132, 4}, {136, 8}, {144, 8},
     {152, 4}, {156, 4}, {160, 4}, {164, 2},  {166, 2}, {168, 2}, {170, 2}, {172, 4}, {176, 8},
     {184, 8}, {192, 8}, {200, 8}, {208, 2},  {210, 8}, {232, 8}, {240, 8}, {248, 8}, {256, 8},
     {264, 8}, {272, 8}, {280, 8}, {288, 8},  {296, 8}, {304, 8}, {312, 8}, {320, 8}, {328, 8},
     {384, 8}, {392, 8}, {504, 8}, {3072, 8}, {4080, 8}}};
// Fields of a channel of the meta page; its name and its unit are texts.
constexpr std::array<Field, 15> kChannelFields{{{0, 1},
                                                {31, 1},
                                                {32, 1},
                                                {33, 1},
                                                {34, 1},
                                                {35, 1},
                                                {36, 1},
                                                {37, 1},
                                                {38, 1},
                                                {39, 1},
                                                {40, 8},
                                                {56, 8},
                                                {64, 8},
                                                {72, 8},
                                                {80, 8}}};

// A mutation of one file.
class Mutation {
 public:
  Mutation(std::vector<std::byte>& file, std::size_t max_bytes, unsigned seed)
      : file_(file), max_bytes_(max_bytes), random_(seed) {
    for (const Field& field : kSuperFields) {
      std::memcpy(&numbers_.emplace_back(0), &file_[find_layout(file_).superblock + field.at],
                  field.bytes);
    }
  }

  void run() {
    for (std::size_t i = below(3) + 1; i > 0; --i) mutate(find_layout(file_));
    const std::size_t repair = below(16);
    seal(file_, repair > 1 ? seals_ : static_cast<unsigned>(below(kSealAll + 1)));
  }

 private:
  std::size_t below(std::size_t n) { return n == 0 ? 0 : random_() % n; }
  template <class Range>
  const auto& any(const Range& range) {
    return range[below(range.size())];
  }

  void mutate(const Layout& layout) {
    // Change the file header, a superblock or any byte.
    const std::size_t super = layout.superblock + 4096 * (below(8) == 0 ? 1 : 0);
    const std::size_t what = below(layout.pages.empty() ? 5 : 24);
    if (what == 0) return change(0, any(kHeaderFields));
    if (what < 3) return change(super, any(kSuperFields));
    if (what == 3) return change(0, {below(file_.size() - 8), 1});
    if (what == 4) return change_tail(layout);
    // Change a page, its entry, the directory or, most often, its payload.
    const Layout::Page& page = any(layout.pages);
    if (what < 7) return change(page.header, any(kPageFields));
    if (what < 9) return change(any(layout.entries), any(kEntryFields));
    if (what < 12) return change_both(page);
    if (what == 12) return swap(page.entry, any(layout.entries), kEntryBytes);
    if (what == 13) return resize_directory(layout);
    if (what == 14) return turn_void(layout);
    change_payload(page);
  }

  // Replaces a number by a near one, a boundary, one of the superblock's numbers, or any number.
  void change(std::size_t base, Field field) {
    std::uint64_t value = 0;
    std::byte* const at = &file_[base + field.at];
    std::memcpy(&value, at, field.bytes);
    const std::uint64_t limit = std::numeric_limits<std::uint64_t>::max() >> (64 - 8 * field.bytes);
    switch (below(6)) {
      case 0:
        value += below(17) - 8;
        break;
      case 1:
        value ^= std::uint64_t{1} << below(8 * field.bytes);
        break;
      case 2:
        value = limit >> below(8 * field.bytes);
        break;
      case 3:
        value = std::uint64_t{1} << below(8 * field.bytes);
        break;
      case 4:
        value = any(numbers_) + below(3) - 1;
        break;
      default:
        value = std::uint64_t{random_()} << 32 | random_();
    }
    std::memcpy(at, &value, field.bytes);
  }

  // Changes a fact of a page in its entry and in its header, so that they agree.
  void change_both(const Layout::Page& page) {
    const std::size_t which = below(kEntryFields.size() - 1) + 1;
    const Field field = kEntryFields[which];
    change(page.entry, field);
    std::memmove(&file_[page.header + kRepeats[which]], &file_[page.entry + field.at], field.bytes);
  }

  void swap(std::size_t a, std::size_t b, std::size_t bytes) {
    if (a != b) std::swap_ranges(&file_[a], &file_[a] + bytes, &file_[b]);
  }

  // Changes an entry that a superblock repeats, or the first place behind them, and has seal()
  // leave it so.
  void change_tail(const Layout& layout) {
    const std::size_t super = layout.superblock + 4096 * (below(8) == 0 ? 1 : 0);
    const std::size_t place = below(std::min<std::size_t>(layout.tail_entries + 1, 64));
    change(super + kTailEntriesAt + kEntryBytes * place, any(kEntryFields));
    seals_ &= ~unsigned{kSealTail};
  }

  // Makes an attribute page void: its entry no longer leads to it, and zeros take its place.
  void turn_void(const Layout& layout) {
    const Layout::Page& page = any(layout.pages);
    if (file_[page.entry + 36] != std::byte{5} && below(8) != 0) return;
    if (below(4) != 0) std::memset(&file_[page.header], 0, 64 + page.stored_bytes);
    std::memset(&file_[page.entry], 0, 24);
  }

  // Repeats an entry of the last directory page or removes it, and adapts counts and ranks.
  void resize_directory(const Layout& layout) {
    const Layout::DirectoryPage& page = layout.directory.back();
    const bool more = below(2) == 0;
    const std::size_t bytes = more ? page.bytes + kEntryBytes : page.bytes - kEntryBytes;
    const std::size_t end = page.header + 64 + page.bytes;
    if (bytes == 0 || (64 + bytes + 4095) / 4096 != (64 + page.bytes + 4095) / 4096) return;
    if (page.header + 64 + bytes > layout.superblock) return;

    // Move the entries behind it.
    const std::size_t at = page.header + 64 + kEntryBytes * below(page.bytes / kEntryBytes);
    const auto type = load<std::uint8_t>(file_.data(), at + 36);
    if (more) {
      std::memmove(&file_[at + kEntryBytes], &file_[at], end - at);
    } else {
      std::memmove(&file_[at], &file_[at + kEntryBytes], end - at - kEntryBytes);
      std::memset(&file_[end - kEntryBytes], 0, kEntryBytes);
    }

    // Adapt the counts of the directory page and of the superblock.
    for (const std::size_t field : {std::size_t{12}, std::size_t{16}})
      store(file_.data(), page.header + field, static_cast<std::uint32_t>(bytes));
    store(file_.data(), page.header + 20, static_cast<std::uint32_t>(bytes / kEntryBytes));
    const auto add = [&](std::size_t field) {
      const auto count = load<std::uint32_t>(file_.data(), layout.superblock + field);
      store(file_.data(), layout.superblock + field, count + (more ? 1U : ~0U));
    };
    add(128);
    if (type == 2) add(152);
    if (type == 1) add(156);
    renumber();
  }

  // Gives all pages the ranks that follow from the order of their entries.
  void renumber() {
    const Layout layout = find_layout(file_);
    std::map<std::uint16_t, std::uint32_t> ranks;  // of the next page, by type and group
    for (const std::size_t entry : layout.entries) {
      const std::uint32_t rank = ranks[load<std::uint16_t>(file_.data(), entry + 36)]++;
      const auto found = std::ranges::find(layout.pages, entry, &Layout::Page::entry);
      if (found != layout.pages.end()) store(file_.data(), found->header + 8, rank);
    }
  }

  // Decodes a payload, changes records, and encodes it by any codec. A packed payload is changed in
  // its packed form.
  void change_payload(const Layout::Page& page) {
    // Decode the payload, or change a byte of one that does not decode.
    std::vector<std::byte> raw;
    const std::span stored(&file_[page.header + 64], page.stored_bytes);
    if (!decode(static_cast<unsigned>(file_[page.header + 6]), stored, raw) || raw.empty()) {
      return change(page.header + 64, {below(page.stored_bytes), 1});
    }

    // Change up to two fields; texts of the meta page may also change their length, and groups of
    // nodes gain or lose their emission.
    const auto type = load<std::uint8_t>(file_.data(), page.header + 4);
    const std::size_t count = load<std::uint32_t>(file_.data(), page.header + 20);
    const bool packed = file_[page.header + 7] != std::byte{0};
    file_.swap(raw);  // because change() works on the file
    for (std::size_t i = below(3); i > 0; --i)
      change(0, packed ? byte_field() : record_field(type, count));
    file_.swap(raw);
    if (type == 1 && count > 0 && below(8) == 0) toggle_emission(raw, count);
    if (type == 4 && below(2) == 0) {
      const std::size_t size = raw.size();
      raw.resize(size + 64);
      raw.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(raw.data()), size, raw.size()));
    }
    if (!raw.empty()) put(page, raw, packed);
  }

  // Gives a group of a node page the columns of emission, all dark, or takes them away, and moves
  // the groups behind it.
  void toggle_emission(std::vector<std::byte>& raw, std::size_t count) {
    const std::size_t slot = below(std::min(count, raw.size() / 2));
    if (raw.size() < 2) return;
    const std::size_t group = std::size_t{8} * load<std::uint16_t>(raw.data(), 2 * slot);
    if (group + 24 > raw.size()) return;
    const auto n = load<std::uint8_t>(raw.data(), group + 17);
    const bool emits = raw[group + 19] != std::byte{0};
    const std::size_t content = 24 + std::size_t{62} * n;
    const std::size_t dark = (content + 7) / 8 * 8;
    const std::size_t bright = (content + std::size_t{24} * n + 7) / 8 * 8;
    if (group + (emits ? bright : dark) > raw.size()) return;
    const auto end = raw.begin() + static_cast<std::ptrdiff_t>(group + dark);
    if (emits) {
      raw.erase(end, end + static_cast<std::ptrdiff_t>(bright - dark));
      std::memset(raw.data() + group + content, 0, dark - content);
    } else {
      raw.insert(end, bright - dark, std::byte{0});
    }
    raw[group + 19] = emits ? std::byte{0} : std::byte{1};
    const std::size_t units = (bright - dark) / 8;
    for (std::size_t later = slot + 1; later < std::min(count, raw.size() / 2); ++later) {
      const std::size_t unit = load<std::uint16_t>(raw.data(), 2 * later);
      store(raw.data(), 2 * later, static_cast<std::uint16_t>(emits ? unit - units : unit + units));
    }
  }

  bool decode(unsigned codec, std::span<const std::byte> stored,
              std::vector<std::byte>& raw) const {
    std::uint64_t size = stored.size();
    if (codec == 1) size = ZSTD_getFrameContentSize(stored.data(), stored.size());
    if (codec == 2 && stored.size() > 4) size = load<std::uint32_t>(stored.data(), 0);
    if (codec > 2 || size > max_bytes_) return false;
    raw.resize(size);
    try {
      PageDecoder().decode({static_cast<Codec>(codec)}, stored, raw);
      return true;
    } catch (const FormatError&) {
      return false;
    }
  }

  Field byte_field() { return {below(file_.size()), 1}; }

  // Returns a field of a payload's records, or any byte of it.
  Field record_field(unsigned type, std::size_t count) {
    Field field = byte_field();
    if (type == 1 && count > 0) field = node_field(count);
    if (type == 2 && count > 0) {
      constexpr std::array<Field, 10> kColumns{
          // bytes per point in front, bytes of a value
          {{0, 4}, {4, 4}, {8, 4}, {12, 4}, {16, 4}, {20, 2}, {24, 2}, {30, 1}, {33, 1}, {34, 2}}};
      const Field column = any(kColumns);
      field = {column.at * count + column.bytes * below(count), column.bytes};
    }
    if (type == 4 && file_.size() >= 8 && below(4) != 0) {
      const std::size_t channel = below(load<std::uint32_t>(file_.data(), 0));
      const Field of = any(kChannelFields);
      field = {8 + 88 * channel + of.at, of.bytes};
    }
    return field.at + field.bytes <= file_.size() ? field : byte_field();
  }

  // Returns a slot, a field of a group's head, a part of a reference, or a number of a column.
  Field node_field(std::size_t count) {
    const std::size_t slot = below(count);
    if (below(8) == 0 || 2 * slot + 2 > file_.size()) return {2 * slot, 2};
    const std::size_t group = std::size_t{8} * load<std::uint16_t>(file_.data(), 2 * slot);
    constexpr std::array<Field, 7> kGroup{
        {{0, 8}, {8, 8}, {16, 1}, {17, 1}, {18, 1}, {19, 1}, {20, 4}}};
    constexpr std::array<Field, 3> kReference{
        {{0, 4}, {4, 2}, {6, 2}}};  // page, slot, number of points of a leaf
    const std::size_t what = below(16);
    if (what < 7) return {group + kGroup[what].at, kGroup[what].bytes};
    if (what < 12) {
      const Field part = any(kReference);
      return {group + 24 + 8 * below(8) + part.at, part.bytes};
    }
    return {group + 32 + 2 * below(340), 2};
  }

  // Writes a payload in place of the old one, and moves what follows: pages of the tail follow each
  // other by sectors, and others keep the directory on a block.
  void put(const Layout::Page& page, const std::vector<std::byte>& raw, bool packed) {
    std::vector<std::byte> stored;
    const Coding coding = PageEncoder(static_cast<Codec>(below(3))).encode(raw, stored);
    const bool in_tail = page.entry < page.header;
    const std::size_t old = (64 + page.stored_bytes + 511) / 512 * 512;
    std::size_t now = (64 + stored.size() + 511) / 512 * 512;
    if (!in_tail) now = now <= old ? old : old + (now - old + 4095) / 4096 * 4096;
    if (now != old && !resize(page, old, now)) return;
    const std::size_t entry = in_tail ? page.entry : page.entry + now - old;
    std::memset(&file_[page.header + 64], 0, std::min(page.stored_bytes, now - 64));
    std::ranges::copy(stored, &file_[page.header + 64]);
    file_[page.header + 6] = static_cast<std::byte>(coding.codec);
    const auto set_both = [&](std::size_t in_header, std::size_t in_entry, std::size_t value) {
      store(file_.data(), page.header + in_header, static_cast<std::uint32_t>(value));
      store(file_.data(), entry + in_entry, static_cast<std::uint32_t>(value));
    };
    set_both(12, 8, stored.size());
    if (!packed) set_both(16, 12, raw.size());
  }

  // Gives a page `now` bytes in place of `old` ones, by zeros at its end, and adapts the offsets of
  // what they move. Returns false when the file would be too long or the page does not lie well.
  bool resize(const Layout::Page& page, std::size_t old, std::size_t now) {
    const Layout layout = find_layout(file_);
    if (page.header + old > layout.superblock || file_.size() + now + 4096 > max_bytes_ + old)
      return false;

    // Adapt the offsets.
    const auto move = [&](std::size_t at) {
      const auto offset = load<std::uint64_t>(file_.data(), at);
      if (offset > page.header) store(file_.data(), at, offset + now - old);
    };
    std::size_t end = page.header + now;  // of the last page, once it is moved
    for (const Layout::Page& other : layout.pages) {
      move(other.entry);
      if (other.header <= page.header) continue;
      end = std::max(end, load<std::uint64_t>(file_.data(), other.entry) + 64 + other.stored_bytes);
    }
    for (const std::size_t copy : {layout.superblock, layout.superblock + 4096}) {
      move(copy + 136);
      move(copy + 200);
    }

    // Move what follows; the superblocks stay on a block.
    const auto place = [&](std::size_t at) {
      return file_.begin() + static_cast<std::ptrdiff_t>(at);
    };
    if (now > old) {
      file_.insert(place(page.header + old), now - old, std::byte{0});
    } else {
      file_.erase(place(page.header + now), place(page.header + old));
    }
    const std::size_t from = layout.superblock + now - old;
    const std::size_t to =
        page.entry < page.header ? (std::min(end, from) + 4095) / 4096 * 4096 : from;
    if (to > from) {
      file_.insert(place(from), to - from, std::byte{0});
    } else {
      file_.erase(place(to), place(from));
    }
    for (const std::size_t copy : {to, to + 4096}) store(file_.data(), copy + 120, file_.size());
    return true;
  }

  std::vector<std::byte>& file_;
  std::size_t max_bytes_;
  std::minstd_rand random_;
  std::vector<std::uint64_t> numbers_;  // values of the superblock's fields
  unsigned seals_ = kSealAll;           // what is to be repaired
};

std::vector<std::vector<std::byte>> read_good_vectors() {
  std::vector<std::vector<std::byte>> files;
  for (const auto& entry : std::filesystem::directory_iterator(PTC_GOOD_VECTORS)) {
    if (!entry.is_regular_file()) continue;  // the parts of a scene
    std::ifstream in(entry.path(), std::ios::binary);
    const std::vector<char> text((std::istreambuf_iterator<char>(in)), {});
    const auto bytes = std::as_bytes(std::span(text));
    files.emplace_back(bytes.begin(), bytes.end());
  }
  return files;
}

}  // namespace
}  // namespace ptc::fuzz

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  static const auto good = ptc::fuzz::read_good_vectors();
  const auto* const bytes = reinterpret_cast<const std::byte*>(data);
  std::vector<std::byte> file(bytes, bytes + size);
  if (seed % 2 == 0) file = good[seed / 2 % good.size()];
  if (file.size() > max_size || file.size() < ptc::fuzz::kMinFile || seed % 32 == 1) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  ptc::fuzz::Mutation(file, max_size, seed).run();
  std::memcpy(data, file.data(), file.size());
  return file.size();
}
