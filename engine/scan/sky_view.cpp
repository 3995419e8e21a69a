#include "engine/scan/sky_view.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"
#include "format/morton.h"

namespace ptc {
namespace {

constexpr int kFineBits = 8;          // of a fine cell's number along an axis, at most
constexpr int kMostBits = 7;          // the same of a cell from which the sky is looked at
constexpr std::uint64_t kInCell = 8;  // places of a cell in the mean, at least
constexpr float kAway = 1.5F;         // cells between a place and the cell from which it looks
constexpr float kAlong = 0.1F;        // cosine to the normal up to which a direction leads along
                                      // the surface
constexpr float kFineAway = 2.5F;     // fine cells between a place and where it looks for open air
constexpr int kOpen = 3;              // directions that are seen in the open, at least

std::size_t cell_at(int x, int y, int z, int bits) noexcept {
  return static_cast<std::size_t>((((z << bits) + y) << bits) + x);
}

/// Returns the axis of a vector's longest component.
std::size_t longest(const std::array<float, 3>& v) noexcept {
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (std::abs(v[k]) > std::abs(v[axis])) axis = k;
  }
  return axis;
}

}  // namespace

void FullCells::halve() {
  const int size = 1 << bits_;
  FullCells wider(bits_ - 1);
  for (int z = 0; z < size; ++z) {
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        if (full_[cell_at(x, y, z, bits_)]) wider.fill(cell_at(x / 2, y / 2, z / 2, wider.bits_));
      }
    }
  }
  *this = std::move(wider);
}

double FullCells::width() const noexcept {
  return std::ldexp(1.0, kLatticeBits - bits_);
}

bool FullCells::is_near(std::size_t cell) const noexcept {
  const std::size_t last = (std::size_t{1} << bits_) - 1;
  bool near = full_[cell];
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t at = (cell >> (axis * bits_)) & last;
    const std::size_t stride = std::size_t{1} << (axis * bits_);
    near = near || (at > 0 && full_[cell - stride]) || (at < last && full_[cell + stride]);
  }
  return near;
}

std::size_t FullCells::cell_of(const LatticePosition& position) const noexcept {
  const auto cell = [&](double x) {
    return static_cast<int>(static_cast<std::uint64_t>(x) >> (kLatticeBits - bits_));
  };
  return cell_at(cell(position[0]), cell(position[1]), cell(position[2]), bits_);
}

std::array<int, 3> FullCells::along(const LatticePosition& position,
                                    const std::array<float, 3>& vector,
                                    float cells) const noexcept {
  std::array<int, 3> cell{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double away = double{cells} * double{vector[k]};
    cell[k] = static_cast<int>(std::floor(position[k] / width() + away));
  }
  return cell;
}

bool FullCells::holds(const std::array<int, 3>& cell) const noexcept {
  return std::ranges::all_of(cell, [this](int c) { return c >= 0 && c < (1 << bits_); });
}

std::size_t FullCells::number(const std::array<int, 3>& cell) const noexcept {
  return cell_at(cell[0], cell[1], cell[2], bits_);
}

SkyView::SkyView() : fine_(kFineBits), cells_(0) {}

void SkyView::add(const LatticePosition& position) noexcept {
  fine_.add(position);
  ++places_;
}

void SkyView::finish(const std::array<float, 3>& up) {
  up_ = up;
  // Make the cells so large that they hold enough places.
  while (fine_.bits() > 1 && kInCell * fine_.count() > places_) fine_.halve();
  cells_ = fine_;
  while (cells_.bits() > kMostBits) cells_.halve();
  // Spread the directions over the upper hemisphere: a ring of eight at 20 degrees, one of five at
  // 45 and one of three at 70.
  const Basis basis(glm::vec3(up[0], up[1], up[2]));
  std::size_t next = 0;
  const auto add_ring = [&](int count, float elevation) {
    const float angle = elevation * kPi / 180;
    for (int i = 0; i < count; ++i) {
      const float turn = 2 * kPi * (static_cast<float>(i) + 0.5F) / static_cast<float>(count);
      const glm::vec3 to = basis.to_world(
          {std::cos(angle) * std::cos(turn), std::cos(angle) * std::sin(turn), std::sin(angle)});
      directions_[next++] = {to.x, to.y, to.z};
    }
  };
  add_ring(8, 20);
  add_ring(5, 45);
  add_ring(3, 70);
  seen_.assign(cells_.size(), 0);
  for (std::size_t d = 0; d < directions_.size(); ++d) look(d);
}

/// Looks in one direction from all cells. The cells are taken in layers across the direction's
/// longest component, from the sky on: a cell sees what the next one in the direction sees.
void SkyView::look(std::size_t direction) {
  const std::array<float, 3>& d = directions_[direction];
  const std::size_t main = longest(d);
  const std::size_t a = main == 0 ? 1 : 0, b = main == 2 ? 1 : 2;
  const int size = 1 << cells_.bits(), step = d[main] > 0 ? 1 : -1;
  const std::array<std::ptrdiff_t, 3> strides{1, size, std::ptrdiff_t{size} * size};
  const auto moved = [&](std::size_t axis, int layer) {
    return static_cast<int>(
        std::floor(double{d[axis]} / double{d[main]} * static_cast<double>(layer) + 0.5));
  };
  const auto bit = static_cast<std::uint16_t>(1U << direction);
  for (int k = 0; k < size; ++k) {
    const int layer = step > 0 ? size - 1 - k : k, ahead = layer + step;
    const int du = moved(a, ahead) - moved(a, layer), dv = moved(b, ahead) - moved(b, layer);
    const std::ptrdiff_t next = step * strides[main] + du * strides[a] + dv * strides[b];
    for (int v = 0; v < size; ++v) {
      const bool inside = ahead >= 0 && ahead < size && v + dv >= 0 && v + dv < size;
      std::ptrdiff_t at = layer * strides[main] + v * strides[b];
      for (int u = 0; u < size; ++u, at += strides[a]) {
        bool sees = true;
        if (inside && u + du >= 0 && u + du < size) {
          const auto other = static_cast<std::size_t>(at + next);
          sees = (seen_[other] & bit) != 0 && !cells_[other];
        }
        if (sees) seen_[static_cast<std::size_t>(at)] |= bit;
      }
    }
  }
}

int SkyView::more_in_front(const LatticePosition& position,
                           const std::array<float, 3>& normal) const noexcept {
  const std::size_t own = cells_.cell_of(position);
  for (const float way : {-kAway, -2 * kAway / 3, -kAway / 3, kAway / 3, 2 * kAway / 3, kAway}) {
    const auto cell = cells_.along(position, normal, way);
    if (cells_.holds(cell) && cells_.number(cell) != own && cells_[cells_.number(cell)]) return 0;
  }
  unsigned front = 0, behind = 0;
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    const std::array<float, 3>& to = directions_[d];
    const float cosine = to[0] * normal[0] + to[1] * normal[1] + to[2] * normal[2];
    front |= (cosine > kAlong ? 1U : 0U) << d;
    behind |= (cosine < -kAlong ? 1U : 0U) << d;
  }
  // Around the grid there is nothing that would hide the sky
  const auto seen = [&](float side) -> unsigned {
    const auto cell = cells_.along(position, normal, side);
    return cells_.holds(cell) ? seen_[cells_.number(cell)] : 0xffff;
  };
  return std::popcount(front & seen(kAway)) - std::popcount(behind & seen(-kAway));
}

SkyView::Air SkyView::air_at(const std::array<int, 3>& fine_cell) const noexcept {
  if (!fine_.holds(fine_cell)) {
    // Around the grid there is air; underneath it the ground may be.
    const auto is_below = [&](std::size_t k) {
      return fine_cell[k] < 0 ? up_[k] > 0.5F
                              : fine_cell[k] >= (1 << fine_.bits()) && up_[k] < -0.5F;
    };
    return is_below(0) || is_below(1) || is_below(2) ? Air::unclear : Air::open;
  }
  if (fine_.is_near(fine_.number(fine_cell))) return Air::unclear;
  std::array<int, 3> cell = fine_cell;
  for (int& c : cell) c >>= fine_.bits() - cells_.bits();
  return std::popcount(seen_[cells_.number(cell)]) < kOpen ? Air::hidden : Air::open;
}

int SkyView::open_side(const LatticePosition& position,
                       const std::array<float, 3>& normal) const noexcept {
  for (const float way :
       {-0.7F * kFineAway, -0.4F * kFineAway, 0.4F * kFineAway, 0.7F * kFineAway}) {
    const auto cell = fine_.along(position, normal, way);
    if (fine_.holds(cell) && fine_[fine_.number(cell)]) return 0;
  }
  const Air front = air_at(fine_.along(position, normal, kFineAway));
  const Air behind = air_at(fine_.along(position, normal, -kFineAway));
  if (front == Air::unclear || behind == Air::unclear || front == behind) return 0;
  return front == Air::open ? 1 : -1;
}

}  // namespace ptc
