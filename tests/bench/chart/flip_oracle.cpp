#include "tests/bench/chart/flip_oracle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

using Colours = std::vector<glm::dvec3>;

// The matrix of IEC 61966-2-1, rows X, Y, Z, and its inverse; white is the sum of each row.
constexpr double kXyz[3][3] = {{0.4123907992659595, 0.3575843393838780, 0.1804807884018343},
                               {0.2126390058715104, 0.7151686787677559, 0.0721923153607337},
                               {0.0193308187155918, 0.1191947797946259, 0.9505321522496608}};
constexpr double kRgb[3][3] = {{3.2409699419045213, -1.5373831775700935, -0.4986107602930033},
                               {-0.9692436362808798, 1.8759675015077206, 0.0415550574071756},
                               {0.0556300796969936, -0.2039769588889765, 1.0569715142428786}};

glm::dvec3 times(const double (&m)[3][3], glm::dvec3 v) noexcept {
  glm::dvec3 result(0);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) result[row] += m[row][column] * v[column];
  }
  return result;
}

glm::dvec3 white() {
  return times(kXyz, glm::dvec3(1));
}

glm::dvec3 ycxcz(glm::dvec3 rgb) {
  const glm::dvec3 xyz = times(kXyz, rgb) / white();
  return {116 * xyz.y - 16, 500 * (xyz.x - xyz.y), 200 * (xyz.y - xyz.z)};
}

glm::dvec3 hunted(glm::dvec3 rgb) {
  glm::dvec3 f = times(kXyz, rgb) / white();
  for (int i = 0; i < 3; ++i) {
    f[i] = f[i] > 216.0 / 24389 ? std::pow(f[i], 1.0 / 3) : (24389.0 / 27 * f[i] + 16) / 116;
  }
  const double lightness = 116 * f.y - 16;
  return {lightness, 0.01 * lightness * 500 * (f.x - f.y), 0.01 * lightness * 200 * (f.y - f.z)};
}

double hyab(glm::dvec3 a, glm::dvec3 b) {
  return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
}

// Sums over a square with weights that depend on the place; edge pixels are repeated beyond the
// edges.
glm::dvec3 sum_at(const Colours& colours, const Image& shape, int x, int y, int radius,
                  const std::function<glm::dvec3(int, int)>& weight) {
  glm::dvec3 sum(0);
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) {
      const int at_x = std::clamp(x + i, 0, static_cast<int>(shape.width) - 1);
      const int at_y = std::clamp(y + j, 0, static_cast<int>(shape.height) - 1);
      const auto at = static_cast<std::size_t>(at_y) * shape.width;
      sum += weight(i, j) * colours[at + static_cast<std::size_t>(at_x)];
    }
  }
  return sum;
}

glm::dvec3 total(int radius, const std::function<glm::dvec3(int, int)>& weight) {
  glm::dvec3 sum(0);
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) sum += weight(i, j);
  }
  return sum;
}

struct Oracle {
  Oracle(const Image& image, double ppd) : shape(image), pixels_per_degree(ppd) {
    for (const glm::vec3& pixel : image.pixels) colours.push_back(ycxcz(glm::dvec3(pixel)));
  }

  // See section "spatial filtering".
  [[nodiscard]] glm::dvec3 seen(int x, int y) const {
    const int radius = static_cast<int>(
        std::ceil(3 * std::sqrt(0.04 / (2 * kPiDouble * kPiDouble)) * pixels_per_degree));
    const auto weight = [this](int i, int j) {
      const double square = (i * i + j * j) / (pixels_per_degree * pixels_per_degree);
      const auto g = [square](double a, double b) {
        return a * std::sqrt(kPiDouble / b) * std::exp(-kPiDouble * kPiDouble / b * square);
      };
      return glm::dvec3(g(1, 0.0047), g(1, 0.0053), g(34.1, 0.04) + g(13.5, 0.025));
    };
    const glm::dvec3 c = sum_at(colours, shape, x, y, radius, weight) / total(radius, weight);
    const double y_share = (c.x + 16) / 116;
    const glm::dvec3 xyz = white() * glm::dvec3(y_share + c.y / 500, y_share, y_share - c.z / 200);
    return hunted(glm::clamp(times(kRgb, xyz), 0.0, 1.0));
  }

  // Lengths of edge and point vectors; see section "feature pipeline".
  [[nodiscard]] std::array<double, 2> features(int x, int y) const {
    const double sigma = 0.5 * 0.082 * pixels_per_degree;
    const int radius = static_cast<int>(std::ceil(3 * sigma));
    const auto bell = [sigma](int i, int j) {
      return std::exp(-(i * i + j * j) / (2 * sigma * sigma));
    };
    const std::function<double(int, int)> edge = [&](int i, int j) { return -i * bell(i, j); };
    const std::function<double(int, int)> point = [&](int i, int j) {
      return (i * i / (sigma * sigma) - 1) * bell(i, j);
    };
    std::array<double, 2> lengths{};
    for (const auto& [filter, length] : {std::pair(edge, 0), std::pair(point, 1)}) {
      const auto parts = [&filter = filter](int i, int j) {
        const double w = filter(i, j);
        return glm::dvec3(std::max(w, 0.0), std::max(-w, 0.0), 0);
      };
      const glm::dvec3 sums = total(radius, parts);
      const auto scaled = [&](int i, int j) {
        const glm::dvec3 part = parts(i, j) / glm::dvec3(sums.x, sums.y, 1);
        return glm::dvec3((part.x - part.y) / 116);
      };
      const double across = sum_at(colours, shape, x, y, radius, scaled).x;
      const double down =
          sum_at(colours, shape, x, y, radius, [&](int i, int j) { return scaled(j, i); }).x;
      lengths[static_cast<std::size_t>(length)] = std::hypot(across, down);
    }
    return lengths;
  }

  const Image& shape;
  double pixels_per_degree;
  Colours colours;
};

double redistributed(double distance) {
  const double most = std::pow(hyab(hunted({0, 1, 0}), hunted({0, 0, 1})), 0.7);
  const double e = std::pow(distance, 0.7);
  if (e < 0.4 * most) return 0.95 / (0.4 * most) * e;
  return 0.95 + (e - 0.4 * most) / (most - 0.4 * most) * 0.05;
}

}  // namespace

std::vector<double> flip_oracle(const Image& test, const Image& reference,
                                double pixels_per_degree) {
  const Oracle a(test, pixels_per_degree);
  const Oracle b(reference, pixels_per_degree);
  std::vector<double> errors;
  for (int y = 0; y < static_cast<int>(test.height); ++y) {
    for (int x = 0; x < static_cast<int>(test.width); ++x) {
      const auto [edge_a, point_a] = a.features(x, y);
      const auto [edge_b, point_b] = b.features(x, y);
      const double difference = std::max(std::abs(edge_a - edge_b), std::abs(point_a - point_b));
      const double feature = std::pow(difference / std::sqrt(2.0), 0.5);
      errors.push_back(std::pow(redistributed(hyab(a.seen(x, y), b.seen(x, y))), 1 - feature));
    }
  }
  return errors;
}

}  // namespace ptc
