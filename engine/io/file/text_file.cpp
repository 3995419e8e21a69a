#include "engine/io/file/text_file.h"

#include <fstream>
#include <span>
#include <sstream>

namespace ptc {

std::string read_text(const InputFile& file) {
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string read_text(const std::filesystem::path& path) {
  return read_text(InputFile(path));
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  OutputFile file(path);
  file.append(std::as_bytes(std::span(text)));
  file.publish();
}

std::string text_of_log(const std::filesystem::path& path) {
  const std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace ptc
