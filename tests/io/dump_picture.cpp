// Writes the pixels of a picture as the reader gives them: a line with width and height, then
// floats R, G and B. With a second picture, which fills the memory of textures, the first goes
// through tiles on the disk. After --opacity, the values are those of its alpha, or nothing.
#include <iostream>
#include <optional>
#include <span>
#include <string>

#include "engine/io/file/file.h"
#include "engine/io/image/byte_range.h"
#include "engine/io/image/texture.h"

int main(int argc, char** argv) {
  try {
    const bool opacity = std::string(argv[1]) == "--opacity";
    const std::string name = argv[opacity ? 2 : 1];
    const bool fill = argc > (opacity ? 3 : 2);
    const auto store = fill ? ptc::TextureStore::make(16 << 20, "/tmp") : ptc::TextureStore::make();
    const auto filler = fill ? std::optional(store->read(argv[argc - 1])) : std::nullopt;
    const ptc::InputFile file(name);
    const ptc::ByteRange bytes(file, 0, file.size());
    const std::optional<ptc::Texture> texture =
        opacity ? store->read_opacity(bytes, name, false) : store->read(bytes, name);
    if (!texture) return 0;
    std::cout << texture->width() << ' ' << texture->height() << '\n';
    texture->visit_rows([](std::span<const glm::vec3> row) {
      const auto bytes_of_row = std::as_bytes(row);
      std::cout.write(reinterpret_cast<const char*>(bytes_of_row.data()),
                      static_cast<std::streamsize>(bytes_of_row.size()));
    });
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
