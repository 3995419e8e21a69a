// Draws a picture on a surface of cairo, as SVG text or as the bytes of a PNG, and publishes the
// file.
#include "tools/bench/chart/picture.h"

#include <cmath>
#include <new>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>

#include "engine/io/file/file.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr double kPixelsAUnit = 2;   // of a PNG
constexpr double kMaxUnits = 16000;  // cairo allows 32767 pixels a side

// Appends a piece of the file to a string. cairo calls this from C, so errors are returned, not
// thrown.
cairo_status_t collect(void* bytes, const unsigned char* data, unsigned count) noexcept {
  try {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), count);
    return CAIRO_STATUS_SUCCESS;
  } catch (const std::bad_alloc&) {
    return CAIRO_STATUS_NO_MEMORY;
  }
}

// Escapes the text of an XML element; control characters that XML does not allow become blanks.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else {
      result += static_cast<unsigned char>(c) < 32 && c != '\n' ? ' ' : c;
    }
  }
  return result;
}

// Removes the number of the surface, which grows through the life of a process: without it equal
// pictures have equal bytes.
std::string without_surface_number(std::string svg) {
  constexpr std::string_view kId = " id=\"surface";
  const std::size_t begin = svg.find(kId);
  if (begin == std::string::npos) return svg;
  const std::size_t end = svg.find('"', begin + kId.size());
  return svg.erase(begin, end + 1 - begin);
}

std::string svg_of(const Picture& picture) {
  std::string svg;
  const Surface surface(
      cairo_svg_surface_create_for_stream(collect, &svg, picture.width, picture.height));
  check(cairo_surface_status(surface.get()));
  cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
  {
    Canvas canvas(surface, 1);
    picture.draw(canvas);
    canvas.check();
  }
  cairo_surface_finish(surface.get());
  check(cairo_surface_status(surface.get()));
  svg = without_surface_number(std::move(svg));
  const std::size_t root = svg.find('>', svg.find("<svg"));
  return svg.insert(root + 1, fmt::format("\n<title>{}</title>\n<desc>{}</desc>",
                                          escaped(picture.title), escaped(picture.description)));
}

std::string png_of(const Picture& picture) {
  const Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(std::lround(picture.width * kPixelsAUnit)),
      static_cast<int>(std::lround(picture.height * kPixelsAUnit))));
  check(cairo_surface_status(surface.get()));
  Canvas canvas(surface, kPixelsAUnit);
  picture.draw(canvas);
  canvas.check();
  std::string png;
  check(cairo_surface_write_to_png_stream(surface.get(), collect, &png));
  return png;
}

}  // namespace

void write_picture(const std::filesystem::path& target, const Picture& picture) {
  const std::string ending = lower_extension(target);
  if (ending != ".svg" && ending != ".png") {
    throw std::invalid_argument("write_picture: the name must end in .svg or .png: " +
                                target.string());
  }
  if (picture.width > kMaxUnits || picture.height > kMaxUnits) {
    throw std::invalid_argument("write_picture: the picture is larger than 16000 units");
  }
  const std::string bytes = ending == ".svg" ? svg_of(picture) : png_of(picture);
  OutputFile file(target);
  file.append(std::as_bytes(std::span(bytes.data(), bytes.size())));
  file.publish();
}

}  // namespace ptc
