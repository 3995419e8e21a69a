// Property, for any bytes as a damaged container: what is salvaged passes the verifier at every
// level, or nothing is written and FormatError says why.
#include "engine/verify/salvage.h"

#include <cstdint>

#include "engine/verify/verify.h"
#include "format/error.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using ptc::fuzz::require;
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const auto kept = ptc::fuzz::MemoryFile::directory() / "kept.ptcx";
  std::filesystem::remove(kept);

  // Salvage what can be salvaged.
  ptc::Progress silent;
  try {
    static_cast<void>(salvage_container(
        file.path(), kept, {.memory_bytes = std::uint64_t{1} << 30, .flip_budget = 1 << 20},
        silent));
  } catch (const ptc::FormatError&) {
    require(!std::filesystem::exists(kept));
    return 0;
  }

  // Verify it.
  const ptc::VerifyReport report = verify_container(
      kept,
      {.level = ptc::VerifyLevel::rebuild, .memory_bytes = std::uint64_t{1} << 30, .threads = 1},
      silent);
  require(report.findings.empty());
  return 0;
}
