// OpenEXR pictures, read some rows at a time in any compression.
//
// A header alone must not make this program allocate much: check_exr_headers() bounds what the
// library allocates.
#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include <ImfChannelList.h>
#include <ImfCompression.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfPartType.h>

#include "engine/base/error.h"
#include "engine/io/image/exr_check.h"
#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

// Returns the names of the channels that give R, G and B: all three the same for a grey picture.
std::array<const char*, 3> colour_channels(const Imf::Header& header) {
  const Imf::ChannelList& channels = header.channels();
  const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
  const std::array<const char*, 3> rgb = {"R", "G", "B"};
  const bool any = std::ranges::any_of(rgb, has);
  if (!any && !has("Y")) throw DataError("the picture has no channel R, G, B or Y");
  const std::array<const char*, 3> names = any ? rgb : std::array<const char*, 3>{"Y", "Y", "Y"};
  for (const char* name : names) {
    const Imf::Channel* channel = channels.findChannel(name);
    if (channel != nullptr && (channel->xSampling != 1 || channel->ySampling != 1)) {
      throw DataError(std::string("channel ") + name + " is subsampled");
    }
  }
  return names;
}

// The data window: its first pixel and its size.
struct Window {
  Imath::V2i low;
  std::uint64_t width = 0;
  std::uint64_t height = 0;
};

// Returns the data window, whose sides are within their limits because check_exr_headers() has
// passed.
Window data_window(const Imf::Header& header) {
  const Imath::Box2i box = header.dataWindow();
  const std::int64_t width = std::int64_t{box.max.x} - box.min.x + 1;
  const std::int64_t height = std::int64_t{box.max.y} - box.min.y + 1;
  return {box.min, static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height)};
}

// Returns how many rows lie in one chunk, so that no chunk is decoded twice. Source: "OpenEXR File
// Layout", section Chunks.
unsigned rows_of_chunk(const Imf::Header& header) {
  if (header.hasTileDescription()) return header.tileDescription().ySize;
  switch (header.compression()) {
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
    case Imf::DWAA_COMPRESSION:
      return 32;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 1;
  }
}

class ExrReader final : public RowReader {
 public:
  ExrReader(const std::filesystem::path& path, const PictureLimits& limits) : path_(path) {
    check_exr_headers(path, limits.max_pixels);
    guarded([&] { open(limits); });
  }

  void read(unsigned rows, std::span<std::byte> out) override {
    const std::size_t row_bytes = window_.width * pixel_bytes(type_);
    for (; rows > 0; --rows, out = out.subspan(row_bytes), ++done_) {
      if (done_ == held_end_) guarded([&] { decode(); });
      std::ranges::copy(std::span(held_).subspan((done_ - held_begin_) * row_bytes, row_bytes),
                        out.begin());
    }
  }

 private:
  // The library throws types of its own.
  template <typename Step>
  void guarded(const Step& step) const {
    try {
      step();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const LimitError&) {
      throw;
    } catch (const std::exception& error) {
      const std::string what = error.what();
      const std::string name = path_.string();
      throw DataError(what.find(name) == std::string::npos ? name + ": EXR: " + what : what);
    }
  }

  void open(const PictureLimits& limits) {
    file_.emplace(path_.c_str(), 0, false);
    const Imf::Header& header = file_->header(0);
    if (header.hasType() && Imf::isDeepData(header.type()))
      throw DataError("deep pictures are not supported");
    window_ = data_window(header);
    channels_ = colour_channels(header);
    const auto is_half = [&](const char* name) {
      const Imf::Channel* channel = header.channels().findChannel(name);
      return channel == nullptr || channel->type == Imf::HALF;
    };
    type_ = std::ranges::all_of(channels_, is_half) ? PixelType::half : PixelType::full;
    width_ = static_cast<unsigned>(window_.width);
    height_ = static_cast<unsigned>(window_.height);
    chunk_rows_ = rows_of_chunk(header);
    check_picture_memory(chunk_bytes(header), "an EXR of chunks that high", limits, path_.string());
    part_.emplace(*file_, 0);
  }

  // Returns the memory while chunks are decoded: their rows here and, where they are tiles, in the
  // library, and a chunk of all channels, packed and unpacked.
  [[nodiscard]] std::uint64_t chunk_bytes(const Imf::Header& header) const {
    const bool tiled = header.hasTileDescription();
    const std::uint64_t rows = std::min(chunk_rows_, height_);
    const std::uint64_t wide = tiled ? header.tileDescription().xSize : width_;
    std::uint64_t pixel = 0;
    for (auto at = header.channels().begin(); at != header.channels().end(); ++at)
      pixel += at.channel().type == Imf::HALF ? 2U : 4U;
    return 2 * rows * width_ * pixel_bytes(type_) + 2 * (tiled ? chunk_rows_ : rows) * wide * pixel;
  }

  // Decodes the rows of the next chunk.
  void decode() {
    const unsigned rows = std::min(chunk_rows_, height_ - done_);
    held_.assign(std::size_t{rows} * width_ * pixel_bytes(type_), std::byte{0});
    const int y = window_.low.y + static_cast<int>(done_);
    const Imath::V2i origin(window_.low.x, y);
    // Decode Y alone to the first component, because a frame buffer holds one slice of each name.
    const bool is_grey = channels_[0] == channels_[1];
    const std::size_t pixel = pixel_bytes(type_), value = pixel / 3;
    Imf::FrameBuffer buffer;
    for (std::size_t i = 0; i < (is_grey ? 1 : 3); ++i) {
      buffer.insert(
          channels_[i],
          Imf::Slice::Make(type_ == PixelType::half ? Imf::HALF : Imf::FLOAT,
                           held_.data() + i * value, origin, static_cast<std::int64_t>(width_),
                           static_cast<std::int64_t>(rows), pixel, pixel * width_));
    }
    part_->setFrameBuffer(buffer);
    part_->readPixels(y, y + static_cast<int>(rows) - 1);
    for (std::size_t at = 0; is_grey && at < held_.size(); at += pixel) {
      std::memcpy(&held_[at + value], &held_[at], value);
      std::memcpy(&held_[at + 2 * value], &held_[at], value);
    }
    held_begin_ = done_;
    held_end_ = done_ + rows;
  }

  std::filesystem::path path_;
  std::optional<Imf::MultiPartInputFile> file_;
  std::optional<Imf::InputPart> part_;  // of file_
  Window window_;
  std::array<const char*, 3> channels_{};
  unsigned chunk_rows_ = 1;
  unsigned done_ = 0;  // rows that were handed out
  std::vector<std::byte> held_;
  unsigned held_begin_ = 0, held_end_ = 0;  // rows
};

}  // namespace

std::unique_ptr<RowReader> open_exr(const std::filesystem::path& path,
                                    const PictureLimits& limits) {
  return std::make_unique<ExrReader>(path, limits);
}

}  // namespace ptc
