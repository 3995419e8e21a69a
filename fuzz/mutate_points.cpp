// Mutates files of points as libFuzzer does, but keeps the first byte, which picks the reader: a
// run that starts with files of one format stays with it. Repairs the checksums of three of four
// E57 files, so that the reader reaches the rules behind them.
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
  if (size < 2 || max_size < 2) return LLVMFuzzerMutate(data, size, max_size);
  const std::size_t length = 1 + LLVMFuzzerMutate(data + 1, size - 1, max_size - 1);
  const auto file = std::as_writable_bytes(std::span(data, length).subspan(1));
  if (seed % 4 != 0 && file.size() >= kSignature.size() &&
      std::memcmp(file.data(), kSignature.data(), kSignature.size()) == 0) {
    ptc::fuzz::seal_e57(file);
  }
  return length;
}
