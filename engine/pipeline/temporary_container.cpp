#include "engine/pipeline/temporary_container.h"

#include <unistd.h>

#include <atomic>

#include <fmt/format.h>

#include "engine/io/file/file.h"

namespace ptc {

std::unique_ptr<ContainerReader> make_temporary_container(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write) {
  static std::atomic<unsigned> made = 0;
  const std::filesystem::path path = directory / fmt::format(".ptcx-{}-{}.ptcx", getpid(), ++made);
  const TemporaryName name(path);  // first, because write() may fail when the file already exists
  write(path);
  return std::make_unique<ContainerReader>(path);
}

}  // namespace ptc
