// PNG files, read row by row through libpng. An interlaced one is decoded as a whole, because each
// of its seven passes goes over the whole picture.
#include <exception>
#include <vector>

#include <png.h>

#include "engine/base/error.h"
#include "engine/io/image/png_guard.h"
#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

class PngReader final : public RowReader, private PngGuard {
 public:
  PngReader(const ByteRange& bytes, const std::string& name, const PictureLimits& limits,
            Channels channels)
      : cursor_(bytes, name), name_(name), alpha_(channels == Channels::alpha) {
    png_ =
        png_create_read_struct(PNG_LIBPNG_VER_STRING, static_cast<PngGuard*>(this), note, ignore);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, &info_, nullptr);
      throw std::bad_alloc();
    }
    try {
      open(bytes.size(), limits);
    } catch (...) {
      png_destroy_read_struct(&png_, &info_, nullptr);
      throw;
    }
  }
  ~PngReader() override { png_destroy_read_struct(&png_, &info_, nullptr); }

  void read(unsigned rows, std::span<std::byte> out) override {
    const std::size_t row_bytes = width_ * pixel_bytes(type_);
    if (interlaced_) return whole_.take(out);
    for (unsigned row = 0; row < rows; ++row) {
      const std::span<std::byte> to = out.subspan(row * row_bytes, row_bytes);
      auto* decoded = reinterpret_cast<png_bytep>(alpha_ ? with_alpha_.data() : to.data());
      guarded([&] { png_read_row(png_, decoded, nullptr); });
      if (alpha_) take_alpha(with_alpha_, to);
    }
    done_ += rows;
    if (done_ == height_) end();
  }

 private:
  static constexpr std::size_t kWithAlpha = 4;  // bytes of a pixel

  void open(std::uint64_t file_bytes, const PictureLimits& limits) {
    guarded([&] {
      png_set_read_fn(png_, this, fill);
      png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
      // Pass over texts, profiles and the like, which may unpack to gigabytes
      png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
      png_read_info(png_, info_);
    });
    const std::uint64_t width = png_get_image_width(png_, info_),
                        height = png_get_image_height(png_, info_);
    check_picture_size(width, height, file_bytes, limits, name_);
    width_ = static_cast<unsigned>(width);
    height_ = static_cast<unsigned>(height);

    // Make every kind of pixel R, G and B of 8 or 16 bits, or these and alpha of 8
    type_ = alpha_                                 ? PixelType::share8
            : png_get_bit_depth(png_, info_) == 16 ? PixelType::srgb16
                                                   : PixelType::srgb8;
    interlaced_ = png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE;
    guarded([&] {
      png_set_expand(png_);
      png_set_gray_to_rgb(png_);
      if (alpha_) {
        png_set_strip_16(png_);
        png_set_add_alpha(png_, 0xff, PNG_FILLER_AFTER);
      } else {
        png_set_strip_alpha(png_);
      }
      if (type_ == PixelType::srgb16) png_set_swap(png_);
      if (interlaced_) png_set_interlace_handling(png_);
      png_read_update_info(png_, info_);
    });
    if (interlaced_) {
      read_whole(limits);
    } else if (alpha_) {
      with_alpha_.resize(kWithAlpha * width_);
    }
  }

  void read_whole(const PictureLimits& limits) {
    const std::size_t row_bytes = width_ * (alpha_ ? kWithAlpha : pixel_bytes(type_));
    check_picture_memory(height_ * std::uint64_t{row_bytes}, "an interlaced PNG", limits, name_);
    std::vector<std::byte> pixels(height_ * row_bytes);
    std::vector<png_bytep> rows(height_);
    for (std::size_t y = 0; y < height_; ++y)
      rows[y] = reinterpret_cast<png_bytep>(&pixels[y * row_bytes]);
    guarded([&] { png_read_image(png_, rows.data()); });
    end();
    if (alpha_) {
      take_alpha(pixels, std::span(pixels).first(std::size_t{width_} * height_));
      pixels.resize(std::size_t{width_} * height_);
    }
    whole_ = WholeRows(std::move(pixels));
  }

  void end() {
    guarded([&] { png_read_end(png_, nullptr); });
  }

  [[noreturn]] void fail() const override {
    if (failure_) std::rethrow_exception(failure_);
    cursor_.fail("libpng: " + message_);
  }

  static void fill(png_structp png, png_bytep out, std::size_t count) {
    auto& reader = *static_cast<PngReader*>(png_get_io_ptr(png));
    try {
      reader.cursor_.take(std::as_writable_bytes(std::span(out, count)));
    } catch (...) {
      reader.failure_ = std::current_exception();
    }
    if (reader.failure_) png_error(png, "the file cannot be read");
  }

  ByteCursor cursor_;
  std::string name_;
  png_infop info_ = nullptr;
  bool alpha_;
  bool interlaced_ = false;
  WholeRows whole_;                    // of an interlaced picture
  unsigned done_ = 0;                  // rows
  std::vector<std::byte> with_alpha_;  // a row
};

}  // namespace

std::unique_ptr<RowReader> open_png(const ByteRange& bytes, const std::string& name,
                                    const PictureLimits& limits, Channels channels) {
  return std::make_unique<PngReader>(bytes, name, limits, channels);
}

}  // namespace ptc
