// OpenEXR pictures: reads any compression, writes ZIP scan lines.
//
// A header alone must not make this program allocate much. check_exr_headers() bounds what the
// library allocates; here the picture grows by the rows that were decoded, in blocks:
//
//   | 256 rows | 256 rows | ... | rest |     a multiple of the rows of a chunk in every compression
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <new>
#include <set>
#include <stdexcept>
#include <utility>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <half.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/image/image_formats.h"

namespace ptc {
namespace {

// Rows per call of the decoder. They are a multiple of the rows of one chunk in every compression,
// so that no chunk is decoded twice.
constexpr std::uint64_t kBlockRows = 256;
// The greatest number of pixels for which memory is reserved before anything is decoded.
constexpr std::uint64_t kTrustedPixels = std::uint64_t{1} << 24;

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

// Decodes rows of the data window to `out`; negative and non-finite values become 0.
void read_rows(Imf::InputPart& part, const Window& window, std::uint64_t row, std::uint64_t rows,
               const std::array<const char*, 3>& channels, glm::vec3* out) {
  const int y = window.low.y + static_cast<int>(row);
  const Imath::V2i origin(window.low.x, y);
  // Decode Y alone to the first component, because a frame buffer holds one slice of each name.
  const int slices = channels[0] == channels[1] ? 1 : 3;
  Imf::FrameBuffer buffer;
  for (int i = 0; i < slices; ++i) {
    buffer.insert(
        channels[static_cast<std::size_t>(i)],
        Imf::Slice::Make(Imf::FLOAT, &(*out)[i], origin, static_cast<std::int64_t>(window.width),
                         static_cast<std::int64_t>(rows), sizeof(glm::vec3),
                         sizeof(glm::vec3) * window.width));
  }
  part.setFrameBuffer(buffer);
  part.readPixels(y, y + static_cast<int>(rows) - 1);
  // Copy Y to the other components and clean the values.
  for (glm::vec3* pixel = out; pixel != out + rows * window.width; ++pixel) {
    if (slices == 1) pixel->y = pixel->z = pixel->x;
    for (int i = 0; i < 3; ++i) {
      if (!std::isfinite((*pixel)[i]) || (*pixel)[i] < 0) (*pixel)[i] = 0;
    }
  }
}

Image decode_first_part(const std::filesystem::path& path) {
  Imf::MultiPartInputFile file(path.c_str(), 0, false);
  const Imf::Header& header = file.header(0);
  if (header.hasType() && Imf::isDeepData(header.type()))
    throw DataError("deep pictures are not supported");
  const Window window = data_window(header);
  const std::array<const char*, 3> channels = colour_channels(header);
  Imf::InputPart part(file, 0);
  Image image{static_cast<unsigned>(window.width), static_cast<unsigned>(window.height), {}};
  const std::uint64_t count = window.width * window.height;
  if (count <= kTrustedPixels) image.pixels.reserve(count);
  for (std::uint64_t row = 0; row < window.height; row += kBlockRows) {
    const std::uint64_t rows = std::min(kBlockRows, window.height - row);
    image.pixels.resize((row + rows) * window.width);
    read_rows(part, window, row, rows, channels, &image.pixels[row * window.width]);
  }
  return image;
}

// A stream that keeps the first error of a write, because the destructor of Imf::OutputFile
// swallows errors.
class PublishedStream : public Imf::OStream {
 public:
  explicit PublishedStream(OutputFile& file) : Imf::OStream(file.target().c_str()), file_(file) {}

  void write(const char bytes[], int count) override {
    try {
      file_.write_at(at_, std::as_bytes(std::span(bytes, static_cast<std::size_t>(count))));
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
      throw;
    }
    at_ += static_cast<std::uint64_t>(count);
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }
  void rethrow_failure() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  OutputFile& file_;
  std::uint64_t at_ = 0;
  std::exception_ptr failure_;
};

std::vector<std::string> channel_names(const ExrLayer& layer) {
  const std::string prefix = layer.name.empty() ? "" : layer.name + ".";
  switch (layer.kind) {
    case ExrLayer::Kind::scalar:
      return {prefix + "V"};
    case ExrLayer::Kind::vector:
      return {prefix + "X", prefix + "Y", prefix + "Z"};
    case ExrLayer::Kind::colour:
      break;
  }
  return {prefix + "R", prefix + "G", prefix + "B"};
}

void check_layers(unsigned width, unsigned height, const std::vector<ExrLayer>& layers) {
  if (!is_image_size(width, height)) {
    throw std::invalid_argument("write_exr: the size is out of range");
  }
  const std::uint64_t count = std::uint64_t{width} * height;
  if (layers.empty()) throw std::invalid_argument("write_exr: there is no layer");
  std::set<std::string> seen;
  for (const ExrLayer& layer : layers) {
    const std::vector<std::string> names = channel_names(layer);
    if (layer.values.size() != count * names.size()) {
      throw std::invalid_argument("write_exr: layer '" + layer.name + "' has " +
                                  std::to_string(layer.values.size()) + " values, not " +
                                  std::to_string(count * names.size()));
    }
    for (const std::string& name : names) {
      if (!seen.insert(name).second) throw std::invalid_argument("write_exr: two channels " + name);
    }
  }
}

// Rounds values to half; finite values beyond its range become the greatest half.
std::vector<half> as_halves(const std::vector<float>& values) {
  std::vector<half> halves(values.size());
  std::ranges::transform(values, halves.begin(), [](float value) {
    const float most = static_cast<float>(HALF_MAX);
    return half(std::isfinite(value) ? std::clamp(value, -most, most) : value);
  });
  return halves;
}

}  // namespace

Image read_exr(const std::filesystem::path& path, std::uint64_t max_pixels) {
  check_exr_headers(path, max_pixels);
  try {
    return decode_first_part(path);
  } catch (const std::exception& error) {  // the library throws types of its own
    const std::string what = error.what();
    const std::string name = path.string();
    throw DataError(what.find(name) == std::string::npos ? name + ": EXR: " + what : what);
  }
}

void write_exr(const std::filesystem::path& target, unsigned width, unsigned height,
               const std::vector<ExrLayer>& layers) {
  check_layers(width, height, layers);

  // Describe the channels and where their values lie.
  Imf::Header header(static_cast<int>(width), static_cast<int>(height));
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  std::vector<std::vector<half>> halves;  // the library wants values in the type that is stored
  halves.reserve(layers.size());
  for (const ExrLayer& layer : layers) {
    if (!layer.full_float) halves.push_back(as_halves(layer.values));
    const Imf::PixelType type = layer.full_float ? Imf::FLOAT : Imf::HALF;
    const std::size_t value_bytes = layer.full_float ? sizeof(float) : sizeof(half);
    const char* base = layer.full_float ? reinterpret_cast<const char*>(layer.values.data())
                                        : reinterpret_cast<const char*>(halves.back().data());
    const std::vector<std::string> names = channel_names(layer);
    const std::size_t stride = value_bytes * names.size();
    for (std::size_t i = 0; i < names.size(); ++i) {
      header.channels().insert(names[i], Imf::Channel(type));
      buffer.insert(names[i], Imf::Slice::Make(type, base + i * value_bytes, header.dataWindow(),
                                               stride, stride * width));
    }
  }

  // Write the picture under a temporary name.
  OutputFile file(target);
  PublishedStream stream(file);
  {
    Imf::OutputFile picture(stream, header, 0);
    picture.setFrameBuffer(buffer);
    picture.writePixels(static_cast<int>(height));
  }
  stream.rethrow_failure();

  // Check that all lines are there: when the library has no memory to compress a line, it leaves
  // the line out without an error.
  const Imf::MultiPartInputFile written(file.temporary().c_str(), 0, false);
  if (!written.partComplete(0)) throw std::bad_alloc();
  file.publish();
}

}  // namespace ptc
