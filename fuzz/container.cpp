// Any bytes as a container: ContainerReader opens and reads every page, or throws FormatError.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/store/reader.h"
#include "format/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int fd = memfd_create("fuzz", 0);
  if (fd < 0 || write(fd, data, size) != static_cast<ssize_t>(size)) std::abort();
  try {
    const ptc::ContainerReader reader("/proc/self/fd/" + std::to_string(fd));
    std::vector<std::byte> payload(reader.page_payload_limit());
    ptc::PageDecoder decoder;
    for (std::uint32_t page = 0; page < reader.page_count(); ++page) {
      (void)reader.read_page(page, payload, decoder);
    }
  } catch (const ptc::FormatError&) {
  }
  close(fd);
  return 0;
}
