// Mutates files of points as libFuzzer does, and repairs the checksums of three of four E57 files,
// so that the reader reaches the rules behind them.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "fuzz/seal_e57.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  constexpr std::string_view kSignature = "ASTM-E57";
  const std::size_t length = LLVMFuzzerMutate(data, size, max_size);
  // The first byte picks the reader.
  const auto file = std::as_writable_bytes(std::span(data, length).subspan(length > 0 ? 1 : 0));
  if (seed % 4 != 0 && file.size() >= kSignature.size() &&
      std::memcmp(file.data(), kSignature.data(), kSignature.size()) == 0) {
    ptc::fuzz::seal_e57(file);
  }
  return length;
}
