#include "tests/io/las_files.h"

namespace ptc::test {

LasCloud read_las(const std::filesystem::path& path) {
  PointFile file = open_las(path);
  LasCloud cloud;
  std::vector<Surfel> some(7);
  while (const std::size_t count = file.source->next(some)) {
    cloud.surfels.insert(cloud.surfels.end(), some.begin(),
                         some.begin() + static_cast<std::ptrdiff_t>(count));
    const auto rows = file.source->attributes();
    cloud.rows.append(reinterpret_cast<const char*>(rows.data()), rows.size());
  }
  cloud.info = std::move(file.info);
  return cloud;
}

LasCloud read_las(const TemporaryDirectory& scratch, const std::string& bytes) {
  return read_las(scratch.file("a.las", bytes));
}

std::string las_fault(const TemporaryDirectory& scratch, const std::string& bytes) {
  const auto path = scratch.file("fault.las", bytes);
  std::string text = refusal([&] { static_cast<void>(read_las(path)); });
  const std::string prefix = path.string() + ": ";
  return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

}  // namespace ptc::test
