// Property, for any bytes as a container: ContainerReader opens the file and reads every page, with
// the values that it promises, or throws FormatError. The verifier does not accept what the reader
// refuses.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using ptc::ContainerReader;
using ptc::fuzz::require;

// Runs a body and says whether it ended without FormatError.
template <class Body>
bool accepts(const Body& body) {
  try {
    body();
    return true;
  } catch (const ptc::FormatError&) {
    return false;
  }
}

// Checks what read_page() promises of a page that it returns.
void check_promises(const ContainerReader& reader, const ptc::PageHeader& page,
                    const std::byte* payload) {
  for (std::uint32_t slot = 0; page.type == ptc::PageType::node && slot < page.record_count;
       ++slot) {
    for (const ptc::NodeChild& child :
         ptc::NodePage(payload, page.record_count).decode(slot).children) {
      const ptc::ChildRef& ref = child.ref;
      require(ref.interior ? reader.entry(ref.page).type == ptc::PageType::node &&
                                 ref.slot < reader.entry(ref.page).record_count
                           : ref.point_count > 0 &&
                                 ref.first_point + ref.point_count <= reader.superblock().points);
    }
  }
  for (std::uint32_t i = 0; page.type == ptc::PageType::point && i < page.record_count; ++i) {
    const ptc::PointRecord point = ptc::PointPage(payload, page.record_count)[i];
    require(point.radius >= 0 && std::isfinite(point.radius) &&
            std::ranges::max(point.radiance) < 0x7c00);
  }
}

// Reads a page whole, then its stored payload, then its header. A read that checks less must accept
// whatever one that checks more has accepted.
bool read_page(const ContainerReader& reader, std::uint32_t page, ptc::PageDecoder& decoder) {
  std::vector<std::byte> read(reader.page_payload_limit()), stored;
  ptc::PageHeader header;
  const bool whole = accepts([&] { header = reader.read_page(page, read, decoder); });
  if (whole) check_promises(reader, header, read.data());
  const bool found = accepts([&] { static_cast<void>(reader.read_page_header(page)); });
  const bool copied = accepts([&] { static_cast<void>(reader.read_stored_page(page, stored)); });
  require(whole <= copied && copied <= found);
  return whole;
}

// Opens a file, reads all pages, and says whether nothing was refused.
bool read_all(const std::filesystem::path& path) {
  bool whole = true;
  return accepts([&] {
           const ContainerReader reader(path);
           ptc::PageDecoder decoder;
           for (std::uint32_t page = 0; page < reader.page_count(); ++page)
             whole &= read_page(reader, page, decoder);
         }) &&
         whole;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const bool read = read_all(file.path());
  ptc::Progress silent;
  const ptc::VerifyReport report = verify_container(
      file.path(), {.memory_bytes = std::uint64_t{1} << 30, .threads = 1, .flip_budget = 1 << 20},
      silent);
  require(read || !report.sound());
  return 0;
}
