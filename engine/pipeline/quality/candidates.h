// Chooses which receivers of pilots are compared with rays, so that few that are off by far more
// than all others are found.
//
//   candidates          . . . . . . . . . . . . . . .    64 of each pilot, at two settings
//   signs of an error   . . _ . . | . . . . . . _ . .    how far these differ, how much light
//   compared                '   ' '       '     '        often where signs are high
//   weight                                               1 / chance
#pragma once

#include <span>
#include <vector>

#include "engine/pipeline/quality/pilots.h"

namespace ptc {

/// Returns the candidates of a pilot, each of which stands for as many receivers.
[[nodiscard]] std::vector<Compared> candidates_of(const Pilot& pilot);

/// Chooses the receivers that are compared, as many in all as the pilots have now: by systematic
/// sampling with chances that rise with the light of a candidate and with the difference of its two
/// results (Madow 1949). A quarter of the chances is alike for all, so that no weight is above four
/// times the mean one.
/// @param coarse, fine  results of the candidates of each pilot at two settings
void choose_compared(std::span<Pilot> pilots, std::span<const std::vector<Shading>> coarse,
                     std::span<const std::vector<Shading>> fine);

}  // namespace ptc
