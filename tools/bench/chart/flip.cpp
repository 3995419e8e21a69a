// The colour pipeline, the feature pipeline and their product, in the order and with the letters of
// Andersson et al. 2020 and its erratum of page 10 (116 instead of 100):
//
//   picture -> Y Cx Cz -+-> blur as the eye does -> Hunt L* a* b* -> distance -> colour error c
//                       |
//                       `-> Y -> edges and points (first, second derivative) --> feature error f
//
//   difference of a pixel = c^(1 - f): colours count more where an edge or a point differs, too
//
// HDR-FLIP is the greatest such difference over several exposures (Andersson et al. 2021).
#include "tools/bench/chart/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <glm/vec3.hpp>

#include "tools/bench/chart/colour.h"
#include "tools/bench/chart/plane_filter.h"

namespace ptc {
namespace {

// Sensitivity of the eye to contrast over frequency [cycles / degree]: a1 exp(-b1 f^2) +
// a2 exp(-b2 f^2).
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kAchromatic = {1, 0.0047, 0, 0};
constexpr Sensitivity kRedGreen = {1, 0.0053, 0, 0};
constexpr Sensitivity kBlueYellow = {34.1, 0.04, 13.5, 0.025};
constexpr double kWidestB = 0.04;  // the widest filter gives one radius for all channels

constexpr float kColourPower = 0.7F;       // qc
constexpr float kBreak = 0.4F;             // pc: this share of the largest colour error ...
constexpr float kBreakError = 0.95F;       // pt: ... becomes this error
constexpr double kFeatureDegrees = 0.082;  // w: width of what the eye takes for an edge
constexpr float kFeaturePower = 0.5F;      // qf

std::size_t radius_of(double sigma) {
  return static_cast<std::size_t>(std::ceil(3 * sigma));
}

// The spatial standard deviation [pixels] of the filter whose spectrum is exp(-b f^2): in space it
// is exp(-pi^2 x^2 / b), x in degrees.
double sigma_of(double b, double pixels_per_degree) {
  return std::sqrt(b / 2) / std::numbers::pi * pixels_per_degree;
}

Plane blurred(const Plane& plane, double sigma, std::size_t radius) {
  const Kernel kernel = gaussian(sigma, radius);
  return filter_columns(filter_rows(plane, kernel), kernel);
}

// A channel as the eye perceives it: filtered by the sum of two Gaussians that is scaled to sum
// to 1. Each Gaussian is a sqrt(pi / b) exp(-pi^2 r^2 / b), also in two dimensions.
Plane perceived(const Plane& plane, const Sensitivity& s, double pixels_per_degree) {
  const std::size_t radius = radius_of(sigma_of(kWidestB, pixels_per_degree));
  const double sigma1 = sigma_of(s.b1, pixels_per_degree);
  Plane first = blurred(plane, sigma1, radius);
  if (s.a2 == 0) return first;
  const double sigma2 = sigma_of(s.b2, pixels_per_degree);
  const auto share = [radius](double a, double b, double sigma) {
    const double sum = gaussian_sum(sigma, radius);
    return a * std::sqrt(std::numbers::pi / b) * sum * sum;
  };
  const double share1 = share(s.a1, s.b1, sigma1);
  const double share2 = share(s.a2, s.b2, sigma2);
  const auto part2 = static_cast<float>(share2 / (share1 + share2));
  const Plane second = blurred(plane, sigma2, radius);
  for (std::size_t i = 0; i < first.values.size(); ++i) {
    first.values[i] += part2 * (second.values[i] - first.values[i]);
  }
  return first;
}

// The channels Y, Cx and Cz of a picture clamped to [0, 1].
std::array<Plane, 3> opponent_planes(const Image& image) {
  std::array<Plane, 3> planes;
  for (Plane& plane : planes) plane = {image.width, image.height, {}};
  for (Plane& plane : planes) plane.values.reserve(image.pixels.size());
  for (glm::vec3 pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] = pixel[c] > 0 ? std::min(pixel[c], 1.0F) : 0.0F;
    const glm::vec3 ycxcz = ycxcz_of_rgb(pixel);
    for (int c = 0; c < 3; ++c) planes[static_cast<std::size_t>(c)].values.push_back(ycxcz[c]);
  }
  return planes;
}

// The colours that the eye sees, as L* a* b* with Hunt's adjustment.
std::vector<glm::vec3> seen_colours(const std::array<Plane, 3>& planes, double pixels_per_degree) {
  const Plane y = perceived(planes[0], kAchromatic, pixels_per_degree);
  const Plane cx = perceived(planes[1], kRedGreen, pixels_per_degree);
  const Plane cz = perceived(planes[2], kBlueYellow, pixels_per_degree);
  std::vector<glm::vec3> colours(y.values.size());
  for (std::size_t i = 0; i < colours.size(); ++i) {
    glm::vec3 rgb = rgb_of_ycxcz({y.values[i], cx.values[i], cz.values[i]});
    for (int c = 0; c < 3; ++c) rgb[c] = std::clamp(rgb[c], 0.0F, 1.0F);
    colours[i] = hunt_lab_of_rgb(rgb);
  }
  return colours;
}

// The lengths of the vectors (across, down).
std::vector<float> magnitude(const Plane& across, const Plane& down) {
  std::vector<float> result(across.values.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    const float x = across.values[i];
    const float y = down.values[i];
    result[i] = std::sqrt(x * x + y * y);
  }
  return result;
}

struct Features {
  std::vector<float> edges;
  std::vector<float> points;
};

// The strength of edges and points in the lightness, from first and second derivatives.
Features features_of(Plane lightness, double pixels_per_degree) {
  for (float& value : lightness.values) value = (value + 16) / 116;  // 0 to 1
  const double sigma = kFeatureDegrees / 2 * pixels_per_degree;
  const std::size_t radius = radius_of(sigma);
  const Kernel bell = gaussian(sigma, radius);
  const Kernel first = first_derivative(sigma, radius);
  const Kernel second = second_derivative(sigma, radius);
  const Plane smooth = filter_rows(lightness, bell);
  return {
      magnitude(filter_columns(filter_rows(lightness, first), bell), filter_columns(smooth, first)),
      magnitude(filter_columns(filter_rows(lightness, second), bell),
                filter_columns(smooth, second))};
}

// The colour error, 0 to 1, in which the small distances take most of the range.
float colour_error(float distance, float largest) {
  const float power = std::pow(distance, kColourPower);
  const float bend = kBreak * largest;
  const float error = power < bend
                          ? power / bend * kBreakError
                          : kBreakError + (power - bend) / (largest - bend) * (1 - kBreakError);
  return std::min(error, 1.0F);
}

// The feature error, 0 to 1: the larger of the differences of edges and of points.
float feature_error(const Features& a, const Features& b, std::size_t i) {
  const float edge = std::abs(a.edges[i] - b.edges[i]);
  const float point = std::abs(a.points[i] - b.points[i]);
  const float error = std::max(edge, point) / std::numbers::sqrt2_v<float>;
  return std::min(std::pow(error, kFeaturePower), 1.0F);
}

void check(const Image& test, const Image& reference, float pixels_per_degree) {
  const std::size_t count = std::size_t{test.width} * test.height;
  if (count == 0 || test.width != reference.width || test.height != reference.height ||
      test.pixels.size() != count || reference.pixels.size() != count) {
    throw std::invalid_argument("flip: the pictures have no pixels or different sizes");
  }
  if (!(pixels_per_degree >= 1 && pixels_per_degree <= 1000)) {
    throw std::invalid_argument("flip: pixels_per_degree must be from 1 to 1000");
  }
}

// What the eye sees of one picture.
struct Seen {
  std::vector<glm::vec3> colours;
  Features features;
};

Seen see(const Image& image, double pixels_per_degree) {
  std::array<Plane, 3> planes = opponent_planes(image);
  std::vector<glm::vec3> colours = seen_colours(planes, pixels_per_degree);
  return {std::move(colours), features_of(std::move(planes[0]), pixels_per_degree)};
}

// The tone mapper (a x^2 + b x) / (c x^2 + d x + e), of light that is 1 where a picture is white.
struct ToneCurve {
  float a = 0.6F * 0.6F * 2.51F, b = 0.6F * 0.03F;
  float c = 0.6F * 0.6F * 2.43F, d = 0.6F * 0.59F, e = 0.14F;

  [[nodiscard]] float at(float x) const { return (a * x * x + b * x) / (c * x * x + d * x + e); }
  // The light that is shown as y: the root of (a - c y) x^2 + (b - d y) x - e y = 0.
  [[nodiscard]] float light_of(float y) const {
    const float p = a - c * y, q = b - d * y, r = -e * y;
    return (-q + std::sqrt(q * q - 4 * p * r)) / (2 * p);
  }
};
constexpr float kShown = 0.85F;  // t: how bright the first and the last exposure show their pixels

float luminance(const glm::vec3& rgb) {
  return 0.2126F * rgb.x + 0.7152F * rgb.y + 0.0722F * rgb.z;
}

// The first and the last exposure in stops. A median of 0 gives way to the smallest light above it.
std::pair<float, float> exposures_of(const Image& reference) {
  std::vector<float> light;
  for (const glm::vec3& pixel : reference.pixels) {
    const float y = luminance(pixel);
    light.push_back(std::isfinite(y) ? std::max(y, 0.0F) : 0.0F);
  }
  std::ranges::sort(light);
  const float most = light.back();
  if (most <= 0) return {0, 0};
  const float median = light[light.size() / 2];
  const float middle = median > 0 ? median : *std::ranges::upper_bound(light, 0.0F);
  const float shown = ToneCurve().light_of(kShown);
  return {std::log2(shown / most), std::log2(shown / middle)};
}

Image tone_mapped(Image image, float stops) {
  const float scale = std::exp2(stops);
  for (glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float light = pixel[c] > 0 ? std::min(pixel[c] * scale, 1e9F) : 0.0F;
      pixel[c] = ToneCurve().at(light);
    }
  }
  return image;
}

}  // namespace

std::vector<float> flip(const Image& test, const Image& reference, float pixels_per_degree) {
  check(test, reference, pixels_per_degree);
  const Seen a = see(test, static_cast<double>(pixels_per_degree));
  const Seen b = see(reference, static_cast<double>(pixels_per_degree));
  // No two colours of [0, 1]^3 are farther apart than pure green and pure blue
  const float largest =
      std::pow(hyab(hunt_lab_of_rgb({0, 1, 0}), hunt_lab_of_rgb({0, 0, 1})), kColourPower);
  std::vector<float> errors(a.colours.size());
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const float colour = colour_error(hyab(a.colours[i], b.colours[i]), largest);
    errors[i] = std::pow(colour, 1 - feature_error(a.features, b.features, i));
  }
  return errors;
}

std::vector<float> hdr_flip(const Image& test, const Image& reference, float pixels_per_degree) {
  check(test, reference, pixels_per_degree);
  const auto [first, last] = exposures_of(reference);
  const auto count = static_cast<unsigned>(std::max(2.0F, std::ceil(last - first)));
  std::vector<float> most(test.pixels.size());
  for (unsigned i = 0; i < count; ++i) {
    const float stops =
        first + (last - first) * static_cast<float>(i) / static_cast<float>(count - 1);
    const std::vector<float> errors =
        flip(tone_mapped(test, stops), tone_mapped(reference, stops), pixels_per_degree);
    for (std::size_t k = 0; k < most.size(); ++k) most[k] = std::max(most[k], errors[k]);
  }
  return most;
}

double mean_of(const std::vector<float>& errors) {
  double sum = 0;
  for (const float error : errors) sum += static_cast<double>(error);
  return errors.empty() ? 0 : sum / static_cast<double>(errors.size());
}

double mean_flip(const Image& test, const Image& reference, float pixels_per_degree) {
  return mean_of(flip(test, reference, pixels_per_degree));
}

}  // namespace ptc
