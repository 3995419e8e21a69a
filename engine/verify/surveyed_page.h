// The check of a single page of a surveyed file against all rules that concern it alone.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/verify/survey.h"

namespace ptc {

/// Reads and checks pages, one at a time.
/// Memory: two pages and what their decoder takes.   Threads: not thread-safe; one for each thread.
class SurveyedPage {
 public:
  /// @param file, survey  must outlive this
  /// @param repair        flip back a bit whose flip makes a checksum right, in memory only, and
  ///                      report no fault
  SurveyedPage(const InputFile& file, const Survey& survey, bool repair = false)
      : file_(file), survey_(survey), repair_(repair) {}

  /// Reads a page and checks its rules until one is broken.
  /// @param level   1: the header; 2: also the payload's checksum; 3: also the decoded content
  /// @param budget  pays for the diagnosis of damage
  /// @return  the first fault; empty when there is none
  /// @throws std::system_error, except for EIO, which is a finding
  [[nodiscard]] std::optional<Finding> check(const PageSite& site, int level, FlipBudget& budget);

  /// Returns the header of the page that check() last passed without a finding.
  [[nodiscard]] const PageHeader& header() const noexcept { return header_; }
  /// Returns the bytes of a point in this file.
  [[nodiscard]] std::uint8_t point_bytes() const noexcept { return survey_.header->point_bytes; }
  /// Returns the decoded payload of the page that check() last passed at level 3.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return std::span(payload_).first(header_.raw_bytes);
  }

 private:
  /// Returns the payload as stored; empty below level 2.
  [[nodiscard]] std::span<const std::byte> stored() const noexcept {
    return std::span(image_).subspan(kPageHeaderBytes);
  }
  [[nodiscard]] std::optional<Finding> check_header(const PageSite& site, FlipBudget& budget);
  [[nodiscard]] std::optional<Finding> check_agreement(const PageSite& site) const;
  [[nodiscard]] std::optional<Finding> check_payload(const PageSite& site, FlipBudget& budget);
  [[nodiscard]] bool has_content() const;
  void check_channels() const;

  /// Flips back the bit that a finding names, if this checker repairs.
  /// @return  whether the bit was flipped
  [[nodiscard]] bool repaired(const Finding& finding, std::uint64_t page_offset);

  const InputFile& file_;
  const Survey& survey_;
  bool repair_;
  PageDecoder decoder_;
  PageHeader header_;
  std::vector<std::byte> image_;    ///< the page as stored, as far as the level needs it
  std::vector<std::byte> payload_;  ///< decoded
};

}  // namespace ptc
