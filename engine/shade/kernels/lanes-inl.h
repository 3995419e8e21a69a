// Steps that several kernels share; every function works on all lanes of a vector. The file is
// included by files that are compiled once for each instruction set, so it is guarded once for each
// instruction set.
//
// append() is the heart of the gather: most of what is tested is dropped, and the rest is packed
// before it is stored.
//
//     lanes   [ a  b  c  d  e  f  g  h ]
//     mask    [ .  x  .  x  x  .  .  x ]
//     stored  [ b  d  e  h | anything  ]     returns 4; the next append() begins after h
#if defined(PTC_SHADE_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef PTC_SHADE_LANES_INL_H
#undef PTC_SHADE_LANES_INL_H
#else
#define PTC_SHADE_LANES_INL_H
#endif

#include <bit>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ptc::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Returns the lanes of a mask as bits, the first lane in bit 0.
template <class D>
HWY_INLINE unsigned bits_of(D d, hn::Mask<D> mask) {
  static_assert(hn::MaxLanes(D()) <= 16);
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0] | unsigned{bits[1]} << 8;
}

#if HWY_TARGET == HWY_AVX2
/// For each mask of 8 lanes, the numbers of the lanes in it, four bits each, the first in the
/// lowest bits: mask 0b10011010 has 0x7431.
struct PackedLanes {
  std::uint32_t lanes[256] = {};
  constexpr PackedLanes() {
    for (unsigned mask = 0; mask < 256; ++mask) {
      for (unsigned lane = 0, at = 0; lane < 8; ++lane) {
        if ((mask >> lane & 1) != 0) lanes[mask] |= lane << 4 * at++;
      }
    }
  }
};
static constexpr PackedLanes kPackedLanes;
#endif

/// Writes the lanes of a mask next to each other, and anything behind them up to a vector's length.
///
/// The lanes are packed in a register: instructions that pack while they store made the gather 1.5
/// to 2.4 times slower on Zen 4. AVX2 uses the table above, because GCC 12 copies the table of
/// Highway 1.0.3 to the stack, 1 KiB each time.
/// @return  the number of lanes in the mask
template <class D, class T>
HWY_INLINE std::size_t append(hn::VFromD<D> lanes, hn::Mask<D> mask, D d, T* to) {
#if HWY_TARGET == HWY_AVX2
  const hn::RebindToUnsigned<D> u;
  const unsigned bits = bits_of(d, mask);
  const auto from =
      hn::And(hn::Shr(hn::Set(u, kPackedLanes.lanes[bits]), hn::ShiftLeft<2>(hn::Iota(u, 0U))),
              hn::Set(u, 7U));
  hn::StoreU(hn::TableLookupLanes(lanes, hn::IndicesFromVec(d, from)), d, to);
  return static_cast<std::size_t>(std::popcount(bits));
#else
  hn::StoreU(hn::Compress(lanes, mask), d, to);
  return hn::CountTrue(d, mask);
#endif
}

/// Colours of RGBE as a product: byte * scale is the value of a channel.
template <class D>
struct UnpackedRgbe {
  hn::VFromD<D> byte[3];  ///< red, green and blue, 0 to 255
  hn::VFromD<D> scale;    ///< 2^(e - 136)
};

/// Unpacks colours.
///
///     31      24 23   16 15    8 7     0
///     [ e       | blue  | green | red  ]      channel = byte * 2^(e - 136)
///
/// The scale is built as a float of exponent field e - 9, so colours of an exponent up to 9, which
/// are below 2^-119, are black.
template <class D>
HWY_INLINE UnpackedRgbe<D> unpack_rgbe(D f, hn::VFromD<hn::RebindToUnsigned<D>> rgbe) {
  const hn::RebindToUnsigned<D> u;
  const hn::RebindToSigned<D> i;
  const auto byte = [&](auto bits) {
    return hn::ConvertTo(f, hn::BitCast(i, hn::And(bits, hn::Set(u, 255U))));
  };
  const auto exponent =
      hn::Max(hn::Sub(hn::BitCast(i, hn::ShiftRight<24>(rgbe)), hn::Set(i, 9)), hn::Zero(i));
  return {{byte(rgbe), byte(hn::ShiftRight<8>(rgbe)), byte(hn::ShiftRight<16>(rgbe))},
          hn::BitCast(f, hn::ShiftLeft<23>(exponent))};
}

}  // namespace ptc::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
