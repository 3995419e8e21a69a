// Surfaces and files of charts.
#include "engine/measure/chart.h"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>

#include <cmath>
#include <new>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "engine/io/file.h"
#include "engine/measure/canvas.h"
#include "engine/measure/chart_drawing.h"
#include "engine/measure/chart_layout.h"

namespace ptc {
namespace {

constexpr double kPixelsAUnit = 2;
constexpr double kMostUnits = 16000;  // cairo's pictures end at 32767 pixels a side

// cairo calls back from C: what goes wrong is returned instead of thrown.
cairo_status_t collect(void* bytes, const unsigned char* data, unsigned count) noexcept {
  try {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), count);
    return CAIRO_STATUS_SUCCESS;
  } catch (const std::bad_alloc&) {
    return CAIRO_STATUS_NO_MEMORY;
  }
}

// Text of an XML element; characters that XML does not know become blanks.
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

// What the outlines of the text no longer say; lines of their own.
std::string description(const Chart& chart, const std::vector<SeriesStyle>& styles) {
  std::string text;
  for (const ChartPanel& panel : chart.panels) {
    text.append(panel.title + ": " + panel.y_label + " over " + panel.x_label + "\n");
  }
  for (const SeriesStyle& style : styles) text.append(style.name + "\n");
  text.append(chart.note);
  return fmt::format("\n<title>{}</title>\n<desc>{}</desc>", escaped(chart.title), escaped(text));
}

// cairo numbers its surfaces through the life of a process and writes the number: it is taken out.
std::string without_surface_number(std::string svg) {
  constexpr std::string_view kId = " id=\"surface";
  const std::size_t begin = svg.find(kId);
  if (begin == std::string::npos) return svg;
  const std::size_t end = svg.find('"', begin + kId.size());
  return svg.erase(begin, end + 1 - begin);
}

std::string svg_of(const Chart& chart, const ChartLayout& layout,
                   const std::vector<SeriesStyle>& styles) {
  std::string svg;
  const Surface surface(
      cairo_svg_surface_create_for_stream(collect, &svg, layout.width, layout.height));
  check(cairo_surface_status(surface.get()));
  cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
  {
    Canvas canvas(surface, 1);
    draw_chart(canvas, chart, layout, styles);
    canvas.check();
  }
  cairo_surface_finish(surface.get());
  check(cairo_surface_status(surface.get()));
  svg = without_surface_number(std::move(svg));
  const std::size_t root = svg.find('>', svg.find("<svg"));
  return svg.insert(root + 1, description(chart, styles));
}

std::string png_of(const Chart& chart, const ChartLayout& layout,
                   const std::vector<SeriesStyle>& styles) {
  const Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(std::lround(layout.width * kPixelsAUnit)),
      static_cast<int>(std::lround(layout.height * kPixelsAUnit))));
  check(cairo_surface_status(surface.get()));
  Canvas canvas(surface, kPixelsAUnit);
  draw_chart(canvas, chart, layout, styles);
  canvas.check();
  std::string png;
  check(cairo_surface_write_to_png_stream(surface.get(), collect, &png));
  return png;
}

ChartLayout measured_layout(const Chart& chart, const std::vector<SeriesStyle>& styles) {
  const Surface paper(cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1));
  const Canvas ruler(paper, 1);
  ChartLayout layout = lay_out(chart, styles, ruler);
  layout.width = std::ceil(layout.width);
  layout.height = std::ceil(layout.height);
  if (layout.width > kMostUnits || layout.height > kMostUnits) {
    throw std::invalid_argument("write_chart: the chart is larger than 16000 units");
  }
  return layout;
}

}  // namespace

void write_chart(const std::filesystem::path& target, const Chart& chart) {
  const std::string ending = target.extension().string();
  if (ending != ".svg" && ending != ".png") {
    throw std::invalid_argument("write_chart: neither .svg nor .png: " + target.string());
  }
  if (chart.panels.empty() || chart.columns == 0) {
    throw std::invalid_argument("write_chart: no panel or no column");
  }
  const std::vector<SeriesStyle> styles = styles_of(chart);
  const ChartLayout layout = measured_layout(chart, styles);
  const std::string bytes =
      ending == ".svg" ? svg_of(chart, layout, styles) : png_of(chart, layout, styles);
  OutputFile file(target);
  file.append(std::as_bytes(std::span(bytes.data(), bytes.size())));
  file.publish();
}

}  // namespace ptc
