// Shapes and text by cairo. Markers are polygons about as large as a circle, with the first corner
// at an angle from the right, clockwise as y points down:
//
//   circle ()   square []   triangle /\   diamond <>   inverted \/   pentagon
//
// The radius of a polygon of n corners and of the circle's area is sqrt(2 pi / (n sin(2 pi / n)))
// times the circle's.
#include "tools/bench/chart/canvas.h"

#include <array>
#include <cmath>
#include <new>
#include <numbers>
#include <stdexcept>

namespace ptc {
namespace {

// Debian installs this font with libcairo2, through fontconfig.
constexpr const char* kFont = "DejaVu Sans";

// The corners of a regular polygon with about the area of the circle.
std::vector<Spot> polygon(Spot centre, int corners, double first_angle) {
  const double angle = 2 * std::numbers::pi / corners;
  const double radius =
      0.87 * kMarkerRadius * std::sqrt(2 * std::numbers::pi / (corners * std::sin(angle)));
  std::vector<Spot> spots;
  spots.reserve(static_cast<std::size_t>(corners));
  for (int i = 0; i < corners; ++i) {
    spots.push_back({centre.x + radius * std::cos(first_angle + i * angle),
                     centre.y + radius * std::sin(first_angle + i * angle)});
  }
  return spots;
}

// The corners of a marker; none for the circle.
std::vector<Spot> corners_of(Spot at, Marker shape) {
  constexpr double kUp = -std::numbers::pi / 2;
  switch (shape) {
    case Marker::square:
      return polygon(at, 4, kUp / 2);
    case Marker::triangle:
      return polygon({at.x, at.y + 0.6}, 3, kUp);
    case Marker::diamond:
      return polygon(at, 4, kUp);
    case Marker::inverted:
      return polygon({at.x, at.y - 0.6}, 3, -kUp);
    case Marker::pentagon:
      return polygon(at, 5, kUp);
    case Marker::circle:
      break;
  }
  return {};
}

}  // namespace

void check(cairo_status_t status) {
  if (status == CAIRO_STATUS_SUCCESS) return;
  if (status == CAIRO_STATUS_NO_MEMORY) throw std::bad_alloc();
  if (status == CAIRO_STATUS_INVALID_STRING) {
    throw std::invalid_argument("chart: a text is not UTF-8");
  }
  throw std::runtime_error(std::string("chart: ") + cairo_status_to_string(status));
}

Canvas::Canvas(const Surface& surface, double scale) : context_(cairo_create(surface.get())) {
  cairo_t* const c = context_.get();
  cairo_scale(c, scale, scale);
  // Unhinted text has the same width in a PNG as in an SVG.
  cairo_font_options_t* const options = cairo_font_options_create();
  cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_antialias(options, CAIRO_ANTIALIAS_GRAY);
  cairo_set_font_options(c, options);
  cairo_font_options_destroy(options);
  cairo_set_line_join(c, CAIRO_LINE_JOIN_ROUND);
}

double Canvas::text_width(const std::string& text, const TextStyle& style) const {
  use(style);
  cairo_text_extents_t extents{};
  cairo_text_extents(context_.get(), text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(Spot at, const std::string& text, const TextStyle& style) {
  cairo_t* const c = context_.get();
  const double width = text_width(text, style);
  const double share = style.align == Align::left ? 0 : (style.align == Align::centre ? 0.5 : 1);
  cairo_move_to(c, at.x - share * width, at.y);
  use(style.colour);
  cairo_show_text(c, text.c_str());
  cairo_new_path(c);
}

void Canvas::text_upwards(Spot at, const std::string& text, const TextStyle& style) {
  cairo_t* const c = context_.get();
  cairo_save(c);
  cairo_translate(c, at.x, at.y);
  cairo_rotate(c, -std::numbers::pi / 2);
  this->text({0, 0}, text, style);
  cairo_restore(c);
}

void Canvas::line(std::span<const Spot> spots, const Stroke& stroke) {
  if (spots.size() < 2) return;
  cairo_t* const c = context_.get();
  cairo_new_path(c);
  for (const Spot& spot : spots) cairo_line_to(c, spot.x, spot.y);
  const std::array dashes = {4 * stroke.width, 2.4 * stroke.width};
  cairo_set_dash(c, dashes.data(), stroke.dashed ? 2 : 0, 0);
  cairo_set_line_width(c, stroke.width);
  use(stroke.colour);
  cairo_stroke(c);
  cairo_set_dash(c, nullptr, 0, 0);
}

void Canvas::fill(const Box& box, const Colour& colour, double opacity) {
  cairo_rectangle(context_.get(), box.left, box.top, box.width(), box.height());
  cairo_set_source_rgba(context_.get(), colour.red, colour.green, colour.blue, opacity);
  cairo_fill(context_.get());
}

void Canvas::marker(Spot at, Marker shape, const Colour& colour) {
  cairo_t* const c = context_.get();
  cairo_new_path(c);
  if (shape == Marker::circle) {
    cairo_arc(c, at.x, at.y, 0.9 * kMarkerRadius, 0, 2 * std::numbers::pi);
  } else {
    for (const Spot& corner : corners_of(at, shape)) cairo_line_to(c, corner.x, corner.y);
  }
  cairo_close_path(c);
  cairo_set_line_width(c, 1.4);
  use(Colour{1, 1, 1});
  cairo_stroke_preserve(c);
  use(colour);
  cairo_fill(c);
}

void Canvas::clip(const Box& box) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), box.left, box.top, box.width(), box.height());
  cairo_clip(context_.get());
}

void Canvas::unclip() {
  cairo_restore(context_.get());
}

void Canvas::check() const {
  ptc::check(cairo_status(context_.get()));
}

void Canvas::use(const TextStyle& style) const {
  cairo_select_font_face(context_.get(), kFont, CAIRO_FONT_SLANT_NORMAL,
                         style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), style.size);
}

void Canvas::use(const Colour& colour) const {
  cairo_set_source_rgb(context_.get(), colour.red, colour.green, colour.blue);
}

}  // namespace ptc
