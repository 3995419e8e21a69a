// OpenEXR pictures, written in scan lines with ZIP compression.
#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <half.h>

#include "engine/io/file/file.h"
#include "engine/io/image/image.h"

namespace ptc {

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

namespace {

std::vector<std::string> channel_names(const ExrLayerType& layer) {
  const std::string prefix = layer.name.empty() ? "" : layer.name + ".";
  switch (layer.kind) {
    case ExrLayerType::Kind::scalar:
      return {prefix + "V"};
    case ExrLayerType::Kind::vector:
      return {prefix + "X", prefix + "Y", prefix + "Z"};
    case ExrLayerType::Kind::channel:
      return {layer.name};
    case ExrLayerType::Kind::colour:
      break;
  }
  return {prefix + "R", prefix + "G", prefix + "B"};
}

void check_layers(const ImageWindow& window, const std::vector<ExrLayerType>& layers) {
  const ImageWindow& w = window;
  if (!is_image_size(w.width, w.height) || !is_image_size(w.full_width, w.full_height) ||
      w.width > w.full_width || w.x > w.full_width - w.width || w.height > w.full_height ||
      w.y > w.full_height - w.height) {
    throw std::invalid_argument("ExrWriter: the size is out of range");
  }
  if (layers.empty()) throw std::invalid_argument("ExrWriter: there is no layer");
  std::set<std::string> seen;
  for (const ExrLayerType& layer : layers) {
    for (const std::string& name : channel_names(layer)) {
      if (!seen.insert(name).second) throw std::invalid_argument("ExrWriter: two channels " + name);
    }
  }
}

// Rounds a value to half; finite values beyond its range become the greatest half.
half as_half(float value) {
  const float most = static_cast<float>(HALF_MAX);
  return half(std::isfinite(value) ? std::clamp(value, -most, most) : value);
}

Imf::PixelType pixel_type(const ExrLayerType& layer) {
  return layer.full_float ? Imf::FLOAT : Imf::HALF;
}

std::size_t value_bytes(const ExrLayerType& layer) {
  return layer.full_float ? sizeof(float) : sizeof(half);
}

}  // namespace

struct ExrWriter::State {
  ImageWindow window;
  std::vector<ExrLayerType> layers;
  OutputFile file;
  PublishedStream stream;
  std::optional<Imf::OutputFile> picture;
  unsigned written = 0;                   // rows
  std::vector<std::vector<half>> halves;  // rows of each layer in the type that is stored

  State(const std::filesystem::path& target, const ImageWindow& held, std::vector<ExrLayerType> of,
        const ExrText& text)
      : window(held), layers(std::move(of)), file(target), stream(file), halves(layers.size()) {
    const auto box = [](unsigned x, unsigned y, unsigned width, unsigned height) {
      const Imath::V2i low(static_cast<int>(x), static_cast<int>(y));
      return Imath::Box2i(
          low, low + Imath::V2i(static_cast<int>(width), static_cast<int>(height)) - Imath::V2i(1));
    };
    Imf::Header header(box(0, 0, window.full_width, window.full_height),
                       box(window.x, window.y, window.width, window.height));
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const ExrLayerType& layer : layers) {
      for (const std::string& name : channel_names(layer))
        header.channels().insert(name, Imf::Channel(pixel_type(layer)));
    }
    for (const auto& [name, value] : text) header.insert(name, Imf::StringAttribute(value));
    try {
      picture.emplace(stream, header, 0);
    } catch (...) {
      stream.rethrow_failure();  // the library would hide the reason
      throw;
    }
  }
};

ExrWriter::ExrWriter(const std::filesystem::path& target, const ImageWindow& window,
                     std::vector<ExrLayerType> layers, const ExrText& text) {
  check_layers(window, layers);
  state_ = std::make_unique<State>(target, window, std::move(layers), text);
}

ExrWriter::~ExrWriter() = default;

void ExrWriter::write(unsigned rows, std::span<const std::span<const float>> values) {
  // Check the values
  State& s = *state_;
  if (rows > s.window.height - s.written || values.size() != s.layers.size())
    throw std::invalid_argument("ExrWriter: rows or layers do not match the picture");
  const std::size_t pixels = std::size_t{rows} * s.window.width;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i].size() != pixels * s.layers[i].components()) {
      throw std::invalid_argument("ExrWriter: layer '" + s.layers[i].name + "' has " +
                                  std::to_string(values[i].size()) + " values, not " +
                                  std::to_string(pixels * s.layers[i].components()));
    }
  }
  if (rows == 0) return;

  // Say where the values of each channel lie
  Imf::FrameBuffer buffer;
  const Imath::V2i origin(static_cast<int>(s.window.x), static_cast<int>(s.window.y + s.written));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ExrLayerType& layer = s.layers[i];
    const auto* base = reinterpret_cast<const char*>(values[i].data());
    if (!layer.full_float) {
      s.halves[i].resize(values[i].size());
      std::ranges::transform(values[i], s.halves[i].begin(), as_half);
      base = reinterpret_cast<const char*>(s.halves[i].data());
    }
    const std::vector<std::string> names = channel_names(layer);
    const std::size_t stride = value_bytes(layer) * names.size();
    for (std::size_t c = 0; c < names.size(); ++c) {
      buffer.insert(names[c],
                    Imf::Slice::Make(pixel_type(layer), base + c * value_bytes(layer), origin,
                                     std::int64_t{s.window.width}, std::int64_t{rows}, stride,
                                     stride * s.window.width));
    }
  }

  // Write them
  try {
    s.picture->setFrameBuffer(buffer);
    s.picture->writePixels(static_cast<int>(rows));
  } catch (...) {
    s.stream.rethrow_failure();
    throw;
  }
  s.written += rows;
}

void ExrWriter::publish() {
  State& s = *state_;
  if (s.written != s.window.height) throw std::invalid_argument("ExrWriter: rows are missing");
  s.picture.reset();
  s.stream.rethrow_failure();
  // Check that all lines are there: when the library has no memory to compress a line, it leaves
  // the line out without an error
  const Imf::MultiPartInputFile written(s.file.temporary().c_str(), 0, false);
  if (!written.partComplete(0)) throw std::bad_alloc();
  s.file.publish();
}

std::uint64_t ExrWriter::bytes(unsigned width, unsigned rows,
                               std::span<const ExrLayerType> layers) noexcept {
  // The library holds the lines of a chunk, as they are and compressed
  constexpr std::uint64_t kChunkRows = 16, kCopies = 3;
  std::uint64_t pixel = 0, halves = 0;
  for (const ExrLayerType& layer : layers) {
    pixel += value_bytes(layer) * layer.components();
    if (!layer.full_float) halves += sizeof(half) * layer.components();
  }
  return std::uint64_t{width} * (kCopies * kChunkRows * pixel + rows * halves);
}

void write_exr(const std::filesystem::path& target, unsigned width, unsigned height,
               const std::vector<ExrLayer>& layers) {
  std::vector<ExrLayerType> types(layers.begin(), layers.end());
  std::vector<std::span<const float>> values;
  for (const ExrLayer& layer : layers) values.emplace_back(layer.values);
  ExrWriter writer(target, ImageWindow::whole(width, height), std::move(types));
  writer.write(height, values);
  writer.publish();
}

}  // namespace ptc
