#include "engine/shade/direction_kernels.h"

#include <bit>
#include <cmath>
#include <limits>

// This file is compiled once per instruction set. The loops are plain C++ for the compiler to
// vectorise; sums keep kPixelLanes partial sums in every version, so all versions agree to the bit.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/shade/direction_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

void draw_face_disc(const FacePixels& pixels, const FaceDisc& disc) {
  // Along the ray t (1, u, v) the plane is at t = height / slope. A shallow paraboloid in place of
  // the flat disc makes the nearest centre win where coplanar discs overlap.
  const float height = disc.cw * disc.nw + disc.cu * disc.nu + disc.cv * disc.nv;
  const float square = disc.radius * disc.radius;
  const float bump = 0.01F / disc.radius;
  const int x0 = disc.x0 / kPixelLanes * kPixelLanes;
  for (int y = disc.y0; y < disc.y1; ++y) {
    const float v = pixels.centre[y];
    const float row_slope = disc.nw + disc.nv * v;
    float* depth = pixels.depth + y * pixels.resolution;
    std::uint32_t* rgbe = pixels.rgbe + y * pixels.resolution;
    const float* length = pixels.length + y * pixels.resolution;
    for (int x = x0; x < disc.x1; x += kPixelLanes) {
      for (int i = x; i < x + kPixelLanes; ++i) {
        const float u = pixels.centre[i];
        const float t = height / (row_slope + disc.nu * u);  // infinite, negative or NaN: a miss
        const float du = u * t - disc.cu, dv = v * t - disc.cv, dw = t - disc.cw;
        const float off = du * du + dv * dv + dw * dw;
        const float z = t * length[i] + bump * off;
        const bool nearer = (z < depth[i]) | ((z == depth[i]) & (disc.rgbe < rgbe[i]));
        const bool take = (t > 0) & (off < square) & nearer;
        depth[i] = take ? z : depth[i];
        rgbe[i] = take ? disc.rgbe : rgbe[i];
      }
    }
  }
}

void sum_face(const FacePixels& pixels, const float* sky, float nw, float nu, float nv, FaceSums& sums) {
  constexpr int L = kPixelLanes;
  const int resolution = pixels.resolution;
  float total[L] = {}, covered[L] = {}, red[L] = {}, green[L] = {}, blue[L] = {};
  float open_w[L] = {}, open_u[L] = {}, open_v[L] = {}, sky_r[L] = {}, sky_g[L] = {}, sky_b[L] = {};
  const int plane = resolution * resolution;
  for (int y = 0; y < resolution; ++y) {
    const float v = pixels.centre[y];
    const float row_cosine = nw + nv * v;
    if (row_cosine + std::abs(nu) <= 0) continue;
    const int row = y * resolution;
    for (int x = 0; x < resolution; x += L) {
      for (int i = 0; i < L; ++i) {
        const int at = row + x + i;
        const float u = pixels.centre[x + i];
        const float cosine = row_cosine + nu * u;
        const float weight = (cosine > 0 ? cosine : 0.0F) * pixels.weight[at];
        const bool empty = pixels.depth[at] == std::numeric_limits<float>::infinity();
        const float shut = empty ? 0.0F : weight;
        const float clear = empty ? weight : 0.0F;
        total[i] += weight;
        covered[i] += shut;
        const std::uint32_t c = pixels.rgbe[at];
        const std::int32_t exponent = static_cast<std::int32_t>(c >> 24) - 9;  // value = m 2^(e - 136)
        const float scale = std::bit_cast<float>((exponent > 0 ? exponent : 0) << 23) * shut;
        red[i] += static_cast<float>(static_cast<std::int32_t>(c & 255)) * scale;
        green[i] += static_cast<float>(static_cast<std::int32_t>(c >> 8 & 255)) * scale;
        blue[i] += static_cast<float>(static_cast<std::int32_t>(c >> 16 & 255)) * scale;
        const float direction = clear / pixels.length[at];
        open_w[i] += direction;
        open_u[i] += direction * u;
        open_v[i] += direction * v;
      }
      if (!sky) continue;
      for (int i = 0; i < L; ++i) {
        const int at = row + x + i;
        const float cosine = row_cosine + nu * pixels.centre[x + i];
        const bool empty = pixels.depth[at] == std::numeric_limits<float>::infinity();
        const float clear = (empty & (cosine > 0)) ? cosine * pixels.weight[at] : 0.0F;
        sky_r[i] += clear * sky[at];
        sky_g[i] += clear * sky[plane + at];
        sky_b[i] += clear * sky[2 * plane + at];
      }
    }
  }
  for (int i = 0; i < L; ++i) {
    sums.total += total[i];
    sums.covered += covered[i];
    sums.light[0] += red[i];
    sums.light[1] += green[i];
    sums.light[2] += blue[i];
    sums.sky[0] += sky_r[i];
    sums.sky[1] += sky_g[i];
    sums.sky[2] += sky_b[i];
    sums.open[0] += open_w[i];
    sums.open[1] += open_u[i];
    sums.open[2] += open_v[i];
  }
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ptc {

HWY_EXPORT(draw_face_disc);
HWY_EXPORT(sum_face);

void draw_face_disc(const FacePixels& pixels, const FaceDisc& disc) {
  HWY_DYNAMIC_DISPATCH(draw_face_disc)(pixels, disc);
}

void sum_face(const FacePixels& pixels, const float* sky, float nw, float nu, float nv, FaceSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_face)(pixels, sky, nw, nu, nv, sums);
}

}  // namespace ptc
#endif
