// What charts are drawn with: shapes and text. Lengths are units of the SVG, and y points
// downwards.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <cairo.h>

namespace ptc {

/// A position on the canvas.
struct Spot {
  double x = 0;
  double y = 0;
};

/// A rectangle on the canvas.
struct Box {
  double left = 0;
  double top = 0;
  double right = 0;
  double bottom = 0;

  [[nodiscard]] double width() const noexcept { return right - left; }
  [[nodiscard]] double height() const noexcept { return bottom - top; }
};

/// A colour in sRGB, each channel from 0 to 1.
struct Colour {
  double red = 0;
  double green = 0;
  double blue = 0;
};

/// Which end of a text, or its middle, lies at the given position.
enum class Align { left, centre, right };

/// How text looks.
struct TextStyle {
  double size = 10;  ///< size of the font, units
  Colour colour;
  Align align = Align::left;
  bool bold = false;
};

/// How a line looks.
struct Stroke {
  double width = 1;
  Colour colour;
  bool dashed = false;
};

/// Shapes of the marks at measured points; `inverted` is a triangle on its tip.
enum class Marker { circle, square, triangle, diamond, inverted, pentagon };

/// Deleter of Surface.
struct SurfaceDestroy {
  void operator()(cairo_surface_t* surface) const noexcept { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDestroy>;

/// Draws on a surface of cairo, which remembers the first error until check() throws it.
class Canvas {
 public:
  /// Prepares to draw on a surface, which must outlive the canvas.
  /// @param scale  pixels or points of the surface for each unit
  Canvas(const Surface& surface, double scale);

  /// The width that text() takes, equal on all kinds of surfaces except for rounding.
  [[nodiscard]] double text_width(const std::string& text, const TextStyle& style) const;
  /// Writes a line of text.
  /// @param at  position on the base line of the end or middle that style.align names
  void text(Spot at, const std::string& text, const TextStyle& style);
  /// Writes a line of text turned by 90 degrees, to be read upwards.
  void text_upwards(Spot at, const std::string& text, const TextStyle& style);
  /// Draws a line through all spots, and nothing for fewer than two.
  void line(std::span<const Spot> spots, const Stroke& stroke);
  /// Fills a box. @param opacity  from 0, invisible, to 1
  void fill(const Box& box, const Colour& colour, double opacity = 1);
  /// Draws a filled marker with a white rim. All shapes have about the same area.
  void marker(Spot at, Marker shape, const Colour& colour);
  /// Restricts drawing to a box until unclip().
  void clip(const Box& box);
  /// Ends clip().
  void unclip();

  /// Throws the first error of this canvas, if there was one.
  /// @throws std::invalid_argument when a text was not UTF-8, std::bad_alloc, std::runtime_error
  void check() const;

 private:
  struct ContextDestroy {
    void operator()(cairo_t* context) const noexcept { cairo_destroy(context); }
  };
  void use(const TextStyle& style) const;
  void use(const Colour& colour) const;

  std::unique_ptr<cairo_t, ContextDestroy> context_;
};

/// The distance from the middle of a marker to its rim, units.
inline constexpr double kMarkerRadius = 3.9;

/// Turns an error of cairo into an exception.
/// @throws std::invalid_argument for CAIRO_STATUS_INVALID_STRING, std::bad_alloc for
///         CAIRO_STATUS_NO_MEMORY, std::runtime_error for any other but CAIRO_STATUS_SUCCESS
void check(cairo_status_t status);

}  // namespace ptc
