#include "tests/io/files.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <system_error>
#include <vector>

#include "engine/base/error.h"
#include "format/error.h"

namespace ptc {

Scratch::Scratch() {
  std::string name = (std::filesystem::temp_directory_path() / "ptc-io-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::system_error(errno, std::generic_category(), "mkdtemp " + name);
  }
  path_ = name;
}

Scratch::~Scratch() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::filesystem::path Scratch::file(const std::string& name, std::string_view bytes) const {
  const std::filesystem::path path = path_ / name;
  std::filesystem::remove(path);  // some systems sync a file that is overwritten
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw std::system_error(EIO, std::generic_category(), "write " + path.string());
  return path;
}

std::string Scratch::listing() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(path_)) {
    names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::string slurp(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const DataError& error) {
    return error.what();
  } catch (const FormatError& error) {
    return error.what();
  } catch (const std::system_error& error) {
    return error.what();
  }
  return {};
}

std::optional<std::filesystem::path> shared_data() {
  const char* const given = std::getenv("PTC_SHARED");
  const std::filesystem::path root =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(PTC_SOURCE_DIR).parent_path() / "shared";
  if (!std::filesystem::is_directory(root / "data")) return std::nullopt;
  return root / "data";
}

}  // namespace ptc
