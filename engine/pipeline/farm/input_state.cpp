#include "engine/pipeline/farm/input_state.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <span>
#include <string>
#include <system_error>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/store/reader.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::size_t kComparedBytes = std::size_t{64} << 10;  // compared of either end of a file

InputState state_of_container(const std::filesystem::path& path) {
  const ContainerReader container(path, ContainerReader::OpenParts::no);
  return {.path = path,
          .bytes = container.superblock().file_bytes,
          .xxh3 = container.superblock().xxh3};
}

InputState state_of(const std::filesystem::path& path) {
  if (is_container(path)) return state_of_container(path);
  const InputFile file(path);
  struct stat status {};
  if (::fstat(file.descriptor(), &status) != 0)
    throw std::system_error(errno, std::generic_category(), "fstat " + path.string());
  InputState state{
      .path = path,
      .bytes = file.size(),
      .modified_ns = std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec};
  std::vector<std::byte> ends(
      static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), 2 * kComparedBytes)));
  const auto head = std::span(ends).first(std::min(ends.size(), kComparedBytes));
  const auto tail = std::span(ends).subspan(head.size());
  file.read_at(0, head);
  file.read_at(file.size() - tail.size(), tail);
  state.xxh3 = xxh3_64(ends);
  return state;
}

/// Says how a file differs from its recorded state; empty when it does not.
std::string difference(const InputState& recorded, const InputState& found) {
  if (found.bytes != recorded.bytes) {
    return "it had " + std::to_string(recorded.bytes) + " bytes and has " +
           std::to_string(found.bytes);
  }
  if (found.xxh3 != recorded.xxh3) return "its content is another one";
  if (found.modified_ns != recorded.modified_ns) return "it was written since";
  return {};
}

}  // namespace

std::vector<std::filesystem::path> files_of(const std::filesystem::path& input) {
  std::vector<std::filesystem::path> files{input};
  if (!std::filesystem::is_regular_file(input) || !is_container(input)) return files;
  const ContainerReader container(input, ContainerReader::OpenParts::no);
  if (!container.header().has_parts()) return files;
  const PartList list = container.read_parts();
  for (const PartRecord& part : list.parts()) files.push_back(directory_of(input) / part.name);
  return files;
}

std::vector<InputState> states_of(const std::filesystem::path& input) {
  std::vector<InputState> states;
  for (const std::filesystem::path& file : files_of(input)) states.push_back(state_of(file));
  return states;
}

void require_unchanged(const std::vector<InputState>& recorded) {
  for (const InputState& state : recorded) {
    const std::string what = std::filesystem::exists(state.path)
                                 ? difference(state, state_of(state.path))
                                 : "it is gone";
    if (what.empty()) continue;
    throw DataError(state.path.string() + ": the file changed since it was planned: " + what +
                    ": plan again");
  }
}

}  // namespace ptc
