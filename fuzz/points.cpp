// Any bytes as a cloud: open_points() and next() give finite surfels with unit normals, or throw
// DataError.
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/points.h"

namespace {

/// A file in memory that can be opened by name, ending as asked.
class MemoryFile {
 public:
  MemoryFile(const std::uint8_t* data, std::size_t size, const char* extension)
      : fd_(memfd_create("fuzz", 0)),
        link_("/tmp/ptc-fuzz-" + std::to_string(getpid()) + extension) {
    if (fd_ < 0 || write(fd_, data, size) != static_cast<ssize_t>(size)) std::abort();
    unlink(link_.c_str());
    if (symlink(("/proc/self/fd/" + std::to_string(fd_)).c_str(), link_.c_str()) != 0) std::abort();
  }
  ~MemoryFile() {
    unlink(link_.c_str());
    close(fd_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] const std::string& path() const { return link_; }

 private:
  int fd_;
  std::string link_;
};

void read_all(const std::string& path) {
  ptc::PointFile file = ptc::open_points(path);
  std::vector<ptc::Surfel> block(256);
  while (const std::size_t count = file.source->next(block)) {
    for (std::size_t i = 0; i < count; ++i) {
      const ptc::Surfel& s = block[i];
      const bool finite = std::isfinite(s.position.x + s.position.y + s.position.z) && s.radius >= 0;
      const float length = s.normal.x * s.normal.x + s.normal.y * s.normal.y + s.normal.z * s.normal.z;
      if (!finite || (file.info.has_normals && std::abs(length - 1) > 1e-4F)) std::abort();
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const char* extension : {".ply", ".xyz"}) {
    const MemoryFile file(data, size, extension);
    try {
      read_all(file.path());
    } catch (const ptc::DataError&) {
    }
  }
  return 0;
}
