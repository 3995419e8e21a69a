#include "engine/pipeline/temporary_container.h"

#include "engine/io/file/file.h"
#include "engine/io/file/temporary_name.h"

namespace ptc {

std::filesystem::path temporary_container_path(const std::filesystem::path& directory) {
  return temporary_name(directory / "scene") += ".ptcx";
}

std::unique_ptr<ContainerReader> make_temporary_container(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write) {
  const std::filesystem::path path = temporary_container_path(directory);
  const TemporaryName name(path);  // first, because write() may fail when the file already exists
  write(path);
  return std::make_unique<ContainerReader>(path);
}

}  // namespace ptc
