#include "tools/bench/experiments/disk_reads.h"

#include <fcntl.h>

#include <fstream>
#include <string>

namespace ptc::bench {

std::uint64_t disk_bytes() {
  std::ifstream facts("/proc/self/io");  // lines of "key: value", proc(5)
  std::string key;
  for (std::uint64_t value = 0; facts >> key >> value;) {
    if (key == "read_bytes:") return value;
  }
  return 0;
}

void forget(const InputFile& file) {
  ::posix_fadvise(file.descriptor(), 0, 0, POSIX_FADV_DONTNEED);
}

}  // namespace ptc::bench
