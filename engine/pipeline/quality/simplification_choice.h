// Chooses how coarsely a container is stored, by the error that this leads to
// (spec/shading.md#simplification).
//
//   rounding       coarsest of four whose error is small beside what is asked
//   merging        2 -> 2.8 -> 4      more, while the error is below what is asked, or less
//                       3.4 <-        the geometric middle of the last two
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/run.h"
#include "engine/store/reader.h"

namespace ptc {

/// A container that was simplified on trial.
struct SimplificationTrial {
  double merging = 0;        ///< argument of merging_of()
  double rounding = 0;       ///< argument of rounding_of()
  std::uint64_t points = 0;  ///< that are left
  std::uint64_t bytes = 0;   ///< of the file
  MergeCounts merged;        ///< what became of the points
  BoundedError found;        ///< of what arrives at the exact points, by a PointJudge
  double light_error = 0;    ///< root mean square, relative, of what leaves them
  double albedo_error = 0;   ///< the same of their albedo

  /// Returns how points are stored.
  [[nodiscard]] Simplification simplification() const;
  /// Returns the greatest of the errors, that of arriving light by its upper bound.
  [[nodiscard]] double error() const noexcept;
};

/// A simplification that was chosen.
struct SimplificationChoice {
  double asked = 0;                         ///< error that was asked for
  bool met = false;                         ///< false: no simplification that was tried meets it
  SimplificationTrial taken;                ///< the trial that was chosen
  std::vector<SimplificationTrial> trials;  ///< all of them, in their order
  std::string before;                       ///< the text kSimplifiedKey of the container, if any

  /// Returns the text kSimplifiedKey.
  [[nodiscard]] std::string record() const;
};

/// Checks what choose_simplification() is asked.
/// @throws RequestError when `asked` is not above 0 and at most 1, or the profile rounds no points
void check_tolerance(double asked, Profile profile);

/// Returns options with what was chosen.
[[nodiscard]] RecodeOptions simplified(RecodeOptions options, const SimplificationChoice& choice);

/// Chooses the coarsest simplification whose error is at most `asked`, to within a tenth of its
/// coarseness.
/// @param merges  whether surfels may be merged
/// @param run     runs a trial with the arguments of merging_of() and rounding_of()
[[nodiscard]] SimplificationChoice search_simplification(
    double asked, bool merges, const std::function<SimplificationTrial(double, double)>& run);

/// Chooses how a container is simplified: search_simplification() with temporary containers. The
/// choice depends on the container alone.
/// @param container  whose errors count from its own points
/// @param asked      relative error, above 0 and at most 1
/// @param options    how it will be written, with a profile that is_rounded()
/// @param target     as for roomiest_temp_dir()
/// @param seconds    gets a row
/// @param progress   gets a stage that counts the points of the trials, and notes on what is not
///                   simplified
/// @throws RequestError when `asked` or the profile is out of range; as recode_container() and
///         PointJudge
[[nodiscard]] SimplificationChoice choose_simplification(const ContainerReader& container,
                                                         double asked, RecodeOptions options,
                                                         const std::filesystem::path& target,
                                                         StageSeconds& seconds, Progress& progress);

/// A container that was built, and simplified if that was asked for.
struct SimplifiedBuild {
  BuildReport report;  ///< of the build; `superblock` is that of the container that was published
  std::optional<SimplificationChoice> choice;
};

/// Builds a container. With a tolerance it goes into a temporary one first, and is written as
/// choose_simplification() says.
/// @param asked  as for choose_simplification(); empty: build_container() alone
/// @throws RequestError when it is to be resumed or appended to another one; as build_container()
///         and choose_simplification()
/// Memory: at most RunOptions::memory_bytes.
[[nodiscard]] SimplifiedBuild build_within(BuildRequest request, std::optional<double> asked,
                                           const std::filesystem::path& target, Progress& progress);

}  // namespace ptc
