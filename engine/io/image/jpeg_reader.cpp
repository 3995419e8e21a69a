// JPEG files, read row by row through libjpeg. Those of several scans, such as progressive ones,
// are held as coefficients by the library, because each scan goes over the whole picture.
//
// libjpeg expects that its error handler does not return. As for PNG, a longjmp() leads back to
// guarded(), which throws.
#include <array>
#include <csetjmp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <jpeglib.h>

#include "engine/base/error.h"
#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

// The greatest number of scans, because each is decoded over the whole picture, even an empty one.
// Encoders write about ten; cjpeg of libjpeg reads scripts of at most 100 (rdswitch.c).
constexpr int kMaxScans = 100;
// The greatest number of pixels in all scans. Ten scans of the largest picture fit; they take about
// half a minute.
constexpr std::uint64_t kMaxScannedPixels = std::uint64_t{1} << 32;

class JpegReader final : public RowReader {
 public:
  JpegReader(const ByteRange& bytes, const std::string& name, const PictureLimits& limits)
      : cursor_(bytes, name), name_(name) {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = [](j_common_ptr jpeg) { longjmp(of(jpeg).jump_, 1); };
    errors_.output_message = [](j_common_ptr /*jpeg*/) {};
    jpeg_.client_data = this;
    try {
      open(bytes.size(), limits);
    } catch (...) {
      jpeg_destroy_decompress(&jpeg_);
      throw;
    }
  }
  ~JpegReader() override { jpeg_destroy_decompress(&jpeg_); }

  void read(unsigned rows, std::span<std::byte> out) override {
    const std::size_t row_bytes = width_ * pixel_bytes(type_);
    for (unsigned row = 0; row < rows; ++row) read_row(out.subspan(row * row_bytes, row_bytes));
    if (jpeg_.output_scanline == height_) {
      guarded([&] { jpeg_finish_decompress(&jpeg_); });
    }
  }

 private:
  static JpegReader& of(j_common_ptr jpeg) { return *static_cast<JpegReader*>(jpeg->client_data); }
  static JpegReader& of(j_decompress_ptr jpeg) {
    return *static_cast<JpegReader*>(jpeg->client_data);
  }

  // Lets the library do something. `step` makes no object with a destructor.
  template <typename Step>
  void guarded(const Step& step) {
    if (setjmp(jump_) != 0) fail();
    step();
  }
  [[noreturn]] void fail() {
    if (failure_) std::rethrow_exception(failure_);
    std::array<char, JMSG_LENGTH_MAX> text{};
    errors_.format_message(reinterpret_cast<j_common_ptr>(&jpeg_), text.data());
    cursor_.fail(std::string("libjpeg: ") + text.data(), source_.bytes_in_buffer);
  }
  // Keeps the exception of a function that the library called, and leaves the library.
  template <typename Step>
  void called(const Step& step) {
    try {
      step();
    } catch (...) {
      failure_ = std::current_exception();
    }
    if (failure_) longjmp(jump_, 1);
  }

  void open(std::uint64_t file_bytes, const PictureLimits& limits) {
    guarded([&] {
      jpeg_create_decompress(&jpeg_);
      set_source();
      jpeg_read_header(&jpeg_, TRUE);
    });
    check_picture_size(jpeg_.image_width, jpeg_.image_height, file_bytes, limits, name_);
    width_ = jpeg_.image_width;
    height_ = jpeg_.image_height;
    has_inks_ = jpeg_.jpeg_color_space == JCS_CMYK || jpeg_.jpeg_color_space == JCS_YCCK;
    jpeg_.out_color_space = has_inks_ ? JCS_CMYK : JCS_RGB;
    if (jpeg_has_multiple_scans(&jpeg_) != FALSE)
      check_picture_memory(coefficient_bytes(), "a JPEG of several scans", limits, name_);
    if (has_inks_) inks_.resize(std::size_t{4} * width_);
    progress_.progress_monitor = [](j_common_ptr jpeg) {
      JpegReader& reader = of(jpeg);
      reader.called([&reader] { reader.check_scans(); });
    };
    jpeg_.progress = &progress_;
    guarded([&] { jpeg_start_decompress(&jpeg_); });
  }

  void set_source() {
    source_.init_source = [](j_decompress_ptr /*jpeg*/) {};
    source_.term_source = [](j_decompress_ptr /*jpeg*/) {};
    source_.resync_to_restart = jpeg_resync_to_restart;
    source_.fill_input_buffer = [](j_decompress_ptr jpeg) -> boolean {
      JpegReader& reader = of(jpeg);
      reader.called([&reader] { reader.fill(); });
      return TRUE;
    };
    source_.skip_input_data = [](j_decompress_ptr jpeg, long count) {
      JpegReader& reader = of(jpeg);
      reader.called([&reader, count] {
        auto left = static_cast<std::size_t>(std::max(0L, count));
        while (left > reader.source_.bytes_in_buffer) {
          left -= reader.source_.bytes_in_buffer;
          reader.fill();
        }
        reader.source_.bytes_in_buffer -= left;
        reader.source_.next_input_byte += left;
      });
    };
    jpeg_.src = &source_;
  }

  void fill() {
    const std::span<const std::byte> bytes = cursor_.some();
    source_.next_input_byte = reinterpret_cast<const JOCTET*>(bytes.data());
    source_.bytes_in_buffer = bytes.size();
  }

  void check_scans() const {
    const auto scans = static_cast<std::uint64_t>(jpeg_.input_scan_number);
    if (scans > kMaxScans)
      cursor_.fail("the JPEG has more than 100 scans", source_.bytes_in_buffer);
    if (scans * width_ * height_ > kMaxScannedPixels)
      cursor_.fail("the scans of the JPEG have more than 2^32 pixels together",
                   source_.bytes_in_buffer);
  }

  // Returns the memory of the coefficients: 64 of 2 bytes for each block of 8 x 8 samples.
  [[nodiscard]] std::uint64_t coefficient_bytes() const {
    std::uint64_t blocks = 0;
    for (int i = 0; i < jpeg_.num_components; ++i) {
      const jpeg_component_info& component = jpeg_.comp_info[i];
      blocks += std::uint64_t{component.width_in_blocks +
                              static_cast<unsigned>(component.h_samp_factor)} *
                (component.height_in_blocks + static_cast<unsigned>(component.v_samp_factor));
    }
    return blocks * sizeof(JBLOCK);
  }

  void read_row(std::span<std::byte> out) {
    auto* to = has_inks_ ? inks_.data() : reinterpret_cast<JSAMPROW>(out.data());
    guarded([&] {
      while (jpeg_read_scanlines(&jpeg_, &to, 1) == 0) {
      }
    });
    if (!has_inks_) return;
    // Inks absorb: what is left is the product of what each leaves. Adobe stores that instead
    const unsigned flip = jpeg_.saw_Adobe_marker != FALSE ? 0 : 255;
    for (std::size_t x = 0; x < width_; ++x) {
      const unsigned black = inks_[4 * x + 3] ^ flip;
      for (std::size_t c = 0; c < 3; ++c)
        out[3 * x + c] = static_cast<std::byte>(((inks_[4 * x + c] ^ flip) * black + 127) / 255);
    }
  }

  ByteCursor cursor_;
  std::string name_;
  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  jpeg_source_mgr source_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf jump_{};
  std::exception_ptr failure_;  // of the file, or of a check
  bool has_inks_ = false;
  std::vector<JSAMPLE> inks_;  // C, M, Y and K of a row
};

}  // namespace

std::unique_ptr<RowReader> open_jpeg(const ByteRange& bytes, const std::string& name,
                                     const PictureLimits& limits) {
  return std::make_unique<JpegReader>(bytes, name, limits);
}

}  // namespace ptc
