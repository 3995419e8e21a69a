// Loops compiled once for each width of vectors, chosen when they run.
//
// The compiler makes vectors of plain loops; which ones it may use is fixed where a function is
// compiled. with_instructions() is compiled several times, and all that a loop calls is inlined
// into each of them, so that one source serves every processor:
//
//   void scale(std::span<float> values, float factor) {
//     with_instructions(widest_instructions(), [=] {
//       for (float& value : values) value *= factor;
//     });
//   }
#pragma once

#include <array>

namespace ptc {

/// Instruction sets that loops are compiled for, by increasing width.
enum class InstructionSet { baseline, avx2, avx512 };

inline constexpr std::array kInstructionSets = {InstructionSet::baseline, InstructionSet::avx2,
                                                InstructionSet::avx512};

/// Returns whether this processor has an instruction set.
[[nodiscard]] inline bool has_instructions(InstructionSet set) noexcept {
#if defined(__x86_64__)
  switch (set) {
    case InstructionSet::baseline:
      return true;
    case InstructionSet::avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
    case InstructionSet::avx512:
      return __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("bmi2");
  }
#endif
  return set == InstructionSet::baseline;
}

/// Returns the widest instruction set of this processor.
[[nodiscard]] inline InstructionSet widest_instructions() noexcept {
  static const InstructionSet widest =
      has_instructions(InstructionSet::avx512) ? InstructionSet::avx512
      : has_instructions(InstructionSet::avx2) ? InstructionSet::avx2
                                               : InstructionSet::baseline;
  return widest;
}

namespace detail {

#if defined(__x86_64__)
template <class Loop>
[[gnu::target("avx2,bmi,bmi2"), gnu::flatten]] void run_avx2(Loop& loop) {
  loop();
}

template <class Loop>
[[gnu::target("avx512f,avx512bw,avx512cd,avx512dq,avx512vl,bmi,bmi2"), gnu::flatten]] void
run_avx512(Loop& loop) {
  loop();
}
#endif

}  // namespace detail

/// Calls loop(), compiled for an instruction set.
/// @param set  one that has_instructions()
template <class Loop>
void with_instructions(InstructionSet set, Loop loop) {
#if defined(__x86_64__)
  if (set == InstructionSet::avx512) return detail::run_avx512(loop);
  if (set == InstructionSet::avx2) return detail::run_avx2(loop);
#endif
  static_cast<void>(set);
  loop();
}

}  // namespace ptc
