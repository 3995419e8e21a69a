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

constexpr std::array<Field, 15> kHeaderFields{{{0, 8},
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
                                               {96, 8}}};
constexpr std::array<Field, 14> kPageFields{{{0, 4},
                                             {4, 2},
                                             {6, 1},
                                             {7, 1},
                                             {8, 4},
                                             {12, 4},
                                             {16, 4},
                                             {20, 2},
                                             {22, 2},
                                             {24, 4},
                                             {28, 4},
                                             {32, 8},
                                             {40, 8},
                                             {48, 8}}};
constexpr std::array<Field, 7> kEntryFields{
    {{0, 8}, {8, 4}, {12, 4}, {16, 8}, {24, 2}, {26, 2}, {28, 4}}};
// Offsets in a page header of the fields of kEntryFields.
constexpr std::array<std::size_t, 7> kRepeats{0, 12, 16, 48, 4, 20, 24};
constexpr std::array<Field, 34> kSuperFields{
    {{0, 8},   {8, 8},   {56, 1},  {120, 8}, {128, 4}, {132, 4}, {136, 8}, {144, 8}, {152, 4},
     {156, 4}, {160, 2}, {162, 2}, {164, 4}, {168, 4}, {172, 4}, {176, 8}, {184, 8}, {192, 8},
     {200, 8}, {232, 8}, {240, 8}, {248, 8}, {256, 8}, {264, 8}, {272, 8}, {280, 8}, {288, 8},
     {296, 8}, {304, 8}, {312, 8}, {320, 8}, {328, 8}, {384, 8}, {392, 8}}};

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
    seal(file_, repair > 1 ? kSealAll : static_cast<unsigned>(below(128)));
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
    const std::size_t what = below(layout.pages.empty() ? 4 : 20);
    if (what == 0) return change(0, any(kHeaderFields));
    if (what < 3) return change(super, any(kSuperFields));
    if (what == 3) return change(0, {below(file_.size() - 8), 1});
    // Change a page, its entry, the directory or, most often, its payload.
    const Layout::Page& page = any(layout.pages);
    if (what < 6) return change(page.header, any(kPageFields));
    if (what < 8) return change(page.entry, any(kEntryFields));
    if (what < 10) return change_both(page);
    if (what == 10) return swap(page.entry, any(layout.pages).entry, 32);
    if (what == 11) return resize_directory(layout);
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

  // Adds an entry that is a copy of another one, or removes one, and adapts all counts.
  void resize_directory(const Layout& layout) {
    const Layout::DirectoryPage& page = layout.directory.back();
    const bool more = below(2) == 0;
    const std::size_t bytes = more ? page.bytes + 32 : page.bytes - 32;
    const std::size_t at = page.header + 64 + page.bytes;
    if (bytes == 0 || page.header + 64 + bytes > layout.superblock) return;
    if (more) {
      std::memcpy(&file_[at], &file_[any(layout.pages).entry], 32);
    } else {
      std::memset(&file_[at - 32], 0, 32);
    }
    store(file_.data(), page.header + 12, static_cast<std::uint32_t>(bytes));
    store(file_.data(), page.header + 16, static_cast<std::uint32_t>(bytes));
    store(file_.data(), page.header + 24, static_cast<std::uint32_t>(bytes / 32));
    const auto pages =
        load<std::uint32_t>(file_.data(), layout.superblock + 128) + (more ? 1U : ~0U);
    store(file_.data(), layout.superblock + 128, pages);
    for (std::size_t i = 0; i < layout.directory.size(); ++i) {
      store(file_.data(), layout.directory[i].header + 8, static_cast<std::uint32_t>(pages + i));
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

    // Change up to two fields; texts of the meta page may also change their length.
    const auto type = load<std::uint16_t>(file_.data(), page.header + 4);
    const std::size_t count = load<std::uint32_t>(file_.data(), page.header + 24);
    const bool packed = file_[page.header + 7] != std::byte{0};
    file_.swap(raw);  // because change() works on the file
    for (std::size_t i = below(3); i > 0; --i)
      change(0, packed ? byte_field() : record_field(type, count));
    file_.swap(raw);
    if (type == 4 && below(2) == 0) {
      const std::size_t size = raw.size();
      raw.resize(size + 64);
      raw.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(raw.data()), size, raw.size()));
    }
    if (!raw.empty()) put(page, raw, packed);
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
      constexpr std::array<std::size_t, 7> kBefore{0, 4, 8, 12, 16, 20, 24};
      const std::size_t before = any(kBefore), bytes = before < 20 ? 4 : 2;
      field = {before * count + bytes * below(count), bytes};
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
    return {group + 32 + 2 * below(240), 2};
  }

  // Writes a payload in place of the old one, and moves what follows when it does not fit.
  void put(const Layout::Page& page, const std::vector<std::byte>& raw, bool packed) {
    std::vector<std::byte> stored;
    const Coding coding = PageEncoder(static_cast<Codec>(below(3))).encode(raw, stored);
    const std::size_t room = (64 + page.stored_bytes + 511) / 512 * 512 - 64;
    const std::size_t more = stored.size() > room ? (stored.size() - room + 4095) / 4096 * 4096 : 0;
    if (more > 0 && !insert_zeros(page, more)) return;
    std::memset(&file_[page.header + 64], 0, page.stored_bytes);
    std::ranges::copy(stored, &file_[page.header + 64]);
    file_[page.header + 6] = static_cast<std::byte>(coding.codec);
    const auto set_both = [&](std::size_t in_header, std::size_t in_entry, std::size_t value) {
      store(file_.data(), page.header + in_header, static_cast<std::uint32_t>(value));
      store(file_.data(), more + page.entry + in_entry, static_cast<std::uint32_t>(value));
    };
    set_both(12, 8, stored.size());
    if (!packed) set_both(16, 12, raw.size());
  }

  // Inserts zeros behind a page and adapts the offsets of what they move. Returns false when the
  // file would be too long.
  bool insert_zeros(const Layout::Page& page, std::size_t bytes) {
    const Layout layout = find_layout(file_);
    if (file_.size() + bytes > max_bytes_ || page.entry < page.header) return false;
    const auto move = [&](std::size_t at) {
      const auto offset = load<std::uint64_t>(file_.data(), at);
      if (offset > page.header) store(file_.data(), at, offset + bytes);
    };
    for (const Layout::Page& other : layout.pages) move(other.entry);
    for (std::size_t copy : {layout.superblock, layout.superblock + 4096}) {
      move(copy + 136);
      store(file_.data(), copy + 120, file_.size() + bytes);
    }
    const std::size_t end =
        std::min((page.header + 64 + page.stored_bytes + 511) / 512 * 512, file_.size());
    file_.insert(file_.begin() + static_cast<std::ptrdiff_t>(end), bytes, std::byte{0});
    return true;
  }

  std::vector<std::byte>& file_;
  std::size_t max_bytes_;
  std::minstd_rand random_;
  std::vector<std::uint64_t> numbers_;  // values of the superblock's fields
};

std::vector<std::vector<std::byte>> read_good_vectors() {
  std::vector<std::vector<std::byte>> files;
  for (const auto& entry : std::filesystem::directory_iterator(PTC_GOOD_VECTORS)) {
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
