// PNG files, written row by row through libpng.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <png.h>

#include "engine/io/file/file.h"
#include "engine/io/image/image.h"
#include "engine/io/image/png_guard.h"
#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

std::uint8_t stored_8_bit(float linear) {
  const double clamped = linear > 0 ? std::min(1.0, static_cast<double>(linear)) : 0.0;
  return static_cast<std::uint8_t>(std::lround(255 * linear_to_srgb(clamped)));
}

}  // namespace

struct PngWriter::State : PngGuard {
  unsigned width, height;
  OutputFile file;
  png_infop info = nullptr;
  unsigned written = 0;           // rows
  std::vector<std::uint8_t> row;  // as stored

  State(const std::filesystem::path& target, unsigned columns, unsigned rows)
      : width(columns), height(rows), file(target), row(std::size_t{3} * columns) {
    png_ =
        png_create_write_struct(PNG_LIBPNG_VER_STRING, static_cast<PngGuard*>(this), note, ignore);
    info = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info == nullptr) {
      png_destroy_write_struct(&png_, &info);
      throw std::bad_alloc();
    }
  }
  ~State() override { png_destroy_write_struct(&png_, &info); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  using PngGuard::guarded;
  [[nodiscard]] png_structp png() const noexcept { return png_; }

  [[noreturn]] void fail() const override {
    if (failure_) std::rethrow_exception(failure_);
    throw std::runtime_error(file.target().string() + ": libpng: " + message_);
  }

  static void append(png_structp png, png_bytep bytes, std::size_t count) {
    auto& state = *static_cast<State*>(png_get_io_ptr(png));
    try {
      state.file.append(std::as_bytes(std::span(bytes, count)));
    } catch (...) {
      state.failure_ = std::current_exception();
    }
    if (state.failure_) png_error(png, "the file cannot be written");
  }
  static void flush(png_structp /*png*/) {}
};

PngWriter::PngWriter(const std::filesystem::path& target, unsigned width, unsigned height) {
  if (!is_image_size(width, height)) {
    throw std::invalid_argument("PngWriter: the size is out of range");
  }
  state_ = std::make_unique<State>(target, width, height);
  State& s = *state_;
  s.guarded([&s] {
    png_set_write_fn(s.png(), &s, State::append, State::flush);
    png_set_IHDR(s.png(), s.info, s.width, s.height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(s.png(), s.info);
  });
}

PngWriter::~PngWriter() = default;

void PngWriter::write(std::span<const glm::vec3> pixels) {
  State& s = *state_;
  if (pixels.size() % s.width != 0 || pixels.size() / s.width > s.height - s.written) {
    throw std::invalid_argument("PngWriter: the number of pixels does not match the size");
  }
  for (; !pixels.empty(); pixels = pixels.subspan(s.width), ++s.written) {
    for (std::size_t x = 0; x < s.width; ++x) {
      for (std::size_t c = 0; c < 3; ++c)
        s.row[3 * x + c] = stored_8_bit(pixels[x][static_cast<int>(c)]);
    }
    s.guarded([&s] { png_write_row(s.png(), s.row.data()); });
  }
}

void PngWriter::publish() {
  State& s = *state_;
  if (s.written != s.height) throw std::invalid_argument("PngWriter: rows are missing");
  s.guarded([&s] { png_write_end(s.png(), s.info); });
  s.file.publish();
}

void write_png(const std::filesystem::path& target, const Image& image) {
  if (image.pixels.size() != std::size_t{image.width} * image.height) {
    throw std::invalid_argument("write_png: the number of pixels does not match the size");
  }
  PngWriter writer(target, image.width, image.height);
  writer.write(image.pixels);
  writer.publish();
}

}  // namespace ptc
