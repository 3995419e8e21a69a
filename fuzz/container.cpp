// Any bytes as a container: ContainerReader opens it and reads every page, the same by either access, or throws
// FormatError; the verifier does not accept what the reader refuses.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/build/verify.h"
#include "engine/store/reader.h"
#include "format/error.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using ptc::ContainerReader;
using ptc::fuzz::require;

template <class Body>
bool accepts(const Body& body) {
  try {
    body();
    return true;
  } catch (const ptc::FormatError&) {
    return false;
  }
}

bool read_page(const ContainerReader& reader, std::uint32_t page, ptc::PageDecoder& decoder) {
  std::vector<std::byte> read(reader.page_payload_limit()), mapped(read), stored;
  ptc::PageHeader header;
  const bool whole = accepts([&] { header = reader.read_page(page, read, decoder); });
  const bool same = whole == accepts([&] {
    static_cast<void>(reader.read_page(page, mapped, decoder, ContainerReader::Access::mmap));
  });
  require(same && (!whole || std::equal(read.begin(), read.begin() + header.raw_bytes, mapped.begin())));
  const bool found = accepts([&] { static_cast<void>(reader.read_page_header(page)); });
  const bool copied = accepts([&] { static_cast<void>(reader.read_stored_page(page, stored)); });
  require(whole <= copied && copied <= found);
  return whole;
}

bool read_all(const std::filesystem::path& path) {
  bool whole = true;
  return accepts([&] {
    const ContainerReader reader(path);
    ptc::PageDecoder decoder;
    for (std::uint32_t page = 0; page < reader.page_count(); ++page) whole &= read_page(reader, page, decoder);
  }) && whole;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const bool read = read_all(file.path());
  ptc::Progress silent;
  const bool verified = accepts([&] {
    static_cast<void>(verify_container(file.path(), {.memory_bytes = std::uint64_t{1} << 30, .threads = 1}, silent));
  });
  require(read || !verified);
  return 0;
}
