// What charts are drawn with: shapes and text in units of the SVG, y downwards.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <cairo.h>

namespace ptc {

struct Spot {
  double x = 0;
  double y = 0;
};

struct Box {
  double left = 0;
  double top = 0;
  double right = 0;
  double bottom = 0;

  [[nodiscard]] double width() const noexcept { return right - left; }
  [[nodiscard]] double height() const noexcept { return bottom - top; }
};

/// sRGB, 0 to 1.
struct Colour {
  double red = 0;
  double green = 0;
  double blue = 0;
};

enum class Align { left, centre, right };

struct TextStyle {
  double size = 10;
  Colour colour;
  Align align = Align::left;
  bool bold = false;
};

struct Stroke {
  double width = 1;
  Colour colour;
  bool dashed = false;
};

enum class Marker { circle, square, triangle, diamond, inverted, pentagon };

struct SurfaceDestroy {
  void operator()(cairo_surface_t* surface) const noexcept { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDestroy>;

/// Draws on a surface of cairo. Errors are kept there until check().
class Canvas {
 public:
  /// @param scale  pixels or points of the surface a unit
  Canvas(const Surface& surface, double scale);

  /// Width that text() takes. The same on every kind of surface but for rounding.
  [[nodiscard]] double text_width(const std::string& text, const TextStyle& style) const;
  /// @param at  on the base line, at the end that style.align names
  void text(Spot at, const std::string& text, const TextStyle& style);
  /// The same, turned to read upwards.
  void text_upwards(Spot at, const std::string& text, const TextStyle& style);
  /// A line through all spots; nothing for fewer than two.
  void line(std::span<const Spot> spots, const Stroke& stroke);
  void fill(const Box& box, const Colour& colour, double opacity = 1);
  /// Filled, with a white rim; all shapes look equally large.
  void marker(Spot at, Marker shape, const Colour& colour);
  /// Only what lies inside is drawn, until unclip().
  void clip(const Box& box);
  void unclip();

  /// @throws std::invalid_argument when a text was no UTF-8, std::bad_alloc, std::runtime_error
  void check() const;

 private:
  struct ContextDestroy {
    void operator()(cairo_t* context) const noexcept { cairo_destroy(context); }
  };
  void use(const TextStyle& style) const;
  void use(const Colour& colour) const;

  std::unique_ptr<cairo_t, ContextDestroy> context_;
};

/// Reach of a marker from its middle.
inline constexpr double kMarkerRadius = 3.9;

/// @throws std::invalid_argument for CAIRO_STATUS_INVALID_STRING, std::bad_alloc for _NO_MEMORY,
///         std::runtime_error for every other but _SUCCESS
void check(cairo_status_t status);

}  // namespace ptc
