#include "tests/io/files.h"

#include <cstdlib>
#include <system_error>

#include "engine/base/error.h"
#include "format/error.h"

namespace ptc {

std::string tga_with_alpha(const std::vector<std::uint8_t>& alpha) {
  std::string bytes(12, '\0');
  bytes[2] = 2;  // true colour, not compressed
  bytes += raw(static_cast<std::uint16_t>(alpha.size())) + raw<std::uint16_t>(1);
  bytes += std::string("\x20\x28");  // 32 bits, of which 8 are alpha; the top row first
  for (const std::uint8_t value : alpha)
    bytes += "\xff\xff\xff" + std::string(1, static_cast<char>(value));
  return bytes;
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
