// Writes the pixels of a picture as the reader gives them: a line with width and height, then
// floats R, G and B. With a second picture, which fills the memory of textures, the first goes
// through tiles on the disk.
#include <iostream>
#include <span>
#include <string>

#include "engine/io/image/texture.h"

int main(int argc, char** argv) {
  try {
    const auto store =
        argc > 2 ? ptc::TextureStore::make(16 << 20, "/tmp") : ptc::TextureStore::make();
    const auto filler = store->read(argv[argc - 1]);
    const ptc::Texture texture = store->read(argv[1]);
    std::cout << texture.width() << ' ' << texture.height() << '\n';
    texture.visit_rows([](std::span<const glm::vec3> row) {
      const auto bytes = std::as_bytes(row);
      std::cout.write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
    });
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
