#include "fuzz/seal_e57.h"

#include <bit>
#include <cstdint>

#include "format/bytes.h"

namespace ptc::fuzz {
namespace {

constexpr std::size_t kLengthAt = 16;  // in the header
constexpr std::size_t kPageSizeAt = 40;
constexpr std::size_t kHeaderBytes = 48;

// Returns the CRC-32C of bytes, bit by bit (RFC 3720, appendix B.4).
std::uint32_t checksum(std::span<const std::byte> bytes) {
  std::uint32_t rest = ~std::uint32_t{0};
  for (const std::byte byte : bytes) {
    rest ^= std::to_integer<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) rest = rest >> 1 ^ ((rest & 1) != 0 ? 0x82f63b78 : 0);
  }
  return ~rest;
}

}  // namespace

void seal_e57(std::span<std::byte> file) {
  if (file.size() < kHeaderBytes) return;
  auto page = load<std::uint64_t>(file.data(), kPageSizeAt);
  if (!std::has_single_bit(page) || page < 64 || page > std::uint64_t{1} << 20) page = 1024;
  if (file.size() < page) return;
  store(file.data(), kLengthAt, std::uint64_t{file.size()});
  for (std::size_t at = 0; file.size() - at >= page; at += page) {
    const auto payload = file.subspan(at, page - 4);
    const std::uint32_t crc = checksum(payload);
    for (std::size_t i = 0; i < 4; ++i) {  // the highest byte first
      file[at + page - 4 + i] = static_cast<std::byte>(crc >> (24 - 8 * i) & 255);
    }
  }
}

}  // namespace ptc::fuzz
