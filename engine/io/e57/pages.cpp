// Reads pages in windows of up to 64, and checks the checksum of each when its bytes are first
// asked for.
#include "engine/io/e57/pages.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "engine/base/error.h"
#include "engine/io/e57/crc32c.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::uint64_t kHeaderBytes = 48;
constexpr std::uint64_t kChecksumBytes = 4;
constexpr std::uint64_t kMinPage = 64;  // the header and a checksum fit in
constexpr std::uint64_t kMaxPage = std::uint64_t{1} << 20;
constexpr std::uint64_t kWindowBytes = std::uint64_t{1} << 16;
constexpr std::uint64_t kMaxWindowPages = 64;  // bits of checked_

constexpr char kMagic[] = "ASTM-E57";
constexpr Field<std::uint32_t> kMajor{8};
constexpr Field<std::uint64_t> kLength{16};
constexpr Field<std::uint64_t> kXmlOffset{24};
constexpr Field<std::uint64_t> kXmlBytes{32};
constexpr Field<std::uint64_t> kPageBytes{40};

std::uint32_t stored_checksum(const std::byte* at) noexcept {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < kChecksumBytes; ++i) {
    value = value << 8 | std::to_integer<std::uint32_t>(at[i]);
  }
  return value;
}

}  // namespace

E57Pages::E57Pages(const std::filesystem::path& path) : file_(path) {
  page_bytes_ = read_page_bytes();
  pages_ = file_.size() / page_bytes_;

  // Read the header once more, now that its checksum can be checked.
  std::array<std::byte, kHeaderBytes> header;
  read(0, header);
  if (kMajor.of(header.data()) != 1) fail_at(kMajor.at, "the E57 version is not 1");
  xml_offset_ = logical(kXmlOffset.of(header.data()), "the XML section", kXmlOffset.at);
  xml_bytes_ = kXmlBytes.of(header.data());
  if (xml_bytes_ > size() - xml_offset_) {
    fail_at(kXmlBytes.at, "the XML section goes on behind the end of the file");
  }
}

std::uint64_t E57Pages::read_page_bytes() const {
  std::array<std::byte, kHeaderBytes> header;
  const auto have = static_cast<std::size_t>(std::min<std::uint64_t>(file_.size(), header.size()));
  file_.read_at(0, std::span(header).first(have));
  if (have < sizeof kMagic - 1 || std::memcmp(header.data(), kMagic, sizeof kMagic - 1) != 0) {
    fail_at(0, "not an E57 file");
  }
  if (have < kHeaderBytes) fail_at(0, "the E57 header has fewer than 48 bytes");
  const std::uint64_t page = kPageBytes.of(header.data());
  if (!std::has_single_bit(page) || page < kMinPage || page > kMaxPage) {
    fail_at(kPageBytes.at, "the page size is not a power of two from 64 to 1048576");
  }
  if (kLength.of(header.data()) != file_.size()) {
    fail_at(kLength.at, "the file has " + std::to_string(file_.size()) +
                            " bytes, but its header says " +
                            std::to_string(kLength.of(header.data())));
  }
  if (file_.size() % page != 0) fail_at(kLength.at, "the file does not end with a whole page");
  return page;
}

std::uint64_t E57Pages::size() const noexcept {
  return pages_ * (page_bytes_ - kChecksumBytes);
}

std::uint64_t E57Pages::logical(std::uint64_t physical, const std::string& what,
                                std::uint64_t at) const {
  if (physical >= file_.size()) fail_at(at, what + " begins behind the end of the file");
  const std::uint64_t payload_bytes = page_bytes_ - kChecksumBytes;
  if (physical % page_bytes_ >= payload_bytes) fail_at(at, what + " begins inside a checksum");
  return physical / page_bytes_ * payload_bytes + physical % page_bytes_;
}

std::uint64_t E57Pages::physical(std::uint64_t logical) const noexcept {
  if (page_bytes_ == 0) return logical;  // while the header is read
  const std::uint64_t payload_bytes = page_bytes_ - kChecksumBytes;
  return logical / payload_bytes * page_bytes_ + logical % payload_bytes;
}

void E57Pages::read(std::uint64_t offset, std::span<std::byte> out) {
  if (offset > size() || out.size() > size() - offset) {
    fail_at(std::min(offset, size()), "the file ends too early");
  }
  const std::uint64_t payload_bytes = page_bytes_ - kChecksumBytes;
  while (!out.empty()) {
    const auto rest = payload(offset / payload_bytes).subspan(offset % payload_bytes);
    const std::size_t count = std::min(rest.size(), out.size());
    std::memcpy(out.data(), rest.data(), count);
    out = out.subspan(count);
    offset += count;
  }
}

std::span<const std::byte> E57Pages::payload(std::uint64_t page) {
  // Move the window to the page.
  if (page < first_ || page - first_ >= window_pages_) {
    const std::uint64_t most =
        std::clamp<std::uint64_t>(kWindowBytes / page_bytes_, 1, kMaxWindowPages);
    window_pages_ = 0;  // nothing is valid if the read fails
    const std::uint64_t count = std::min(most, pages_ - page);
    window_.resize(count * page_bytes_);
    file_.read_at(page * page_bytes_, window_);
    first_ = page;
    window_pages_ = count;
    checked_ = 0;
  }

  // Check the page.
  const std::uint64_t slot = page - first_;
  const auto whole = std::span<const std::byte>(window_).subspan(slot * page_bytes_, page_bytes_);
  const auto bytes = whole.first(page_bytes_ - kChecksumBytes);
  if ((checked_ >> slot & 1) == 0) {
    if (crc32c(bytes) != stored_checksum(bytes.data() + bytes.size())) {
      fail_at(page * bytes.size(), "the checksum of the page is wrong");
    }
    checked_ |= std::uint64_t{1} << slot;
  }
  return bytes;
}

void E57Pages::fail_at(std::uint64_t offset, const std::string& rule) const {
  throw DataError(path().string() + ": offset " + std::to_string(physical(offset)) + ": " + rule);
}

}  // namespace ptc
