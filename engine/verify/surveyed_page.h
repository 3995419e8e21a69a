// One page of a surveyed file, read and held to its rules.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/verify/survey.h"

namespace ptc {

/// Reads pages. One per thread.   Memory: two pages and what their decoder takes.
class SurveyedPage {
 public:
  /// Both must outlive this.
  /// @param repair  a bit whose flip makes a checksum right is flipped, and no fault
  SurveyedPage(const InputFile& file, const Survey& survey, bool repair = false)
      : file_(file), survey_(survey), repair_(repair) {}

  /// Reads a page and goes through its rules until one is broken.
  /// @param level   1: its header; 2: and its payload's checksum; 3: and what it decodes to
  /// @param budget  for telling what may have damaged it
  /// @return  what is wrong, or nothing
  /// @throws std::system_error but for EIO, which is a finding
  [[nodiscard]] std::optional<Finding> check(const PageSite& site, int level, FlipBudget& budget);

  /// Of the page last checked without a finding.
  [[nodiscard]] const PageHeader& header() const noexcept { return header_; }
  /// Its payload, when the level was 3.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return std::span(payload_).first(header_.raw_bytes);
  }

 private:
  /// Its payload as it is stored, from level 2 on.
  [[nodiscard]] std::span<const std::byte> stored() const noexcept {
    return std::span(image_).subspan(kPageHeaderBytes);
  }
  [[nodiscard]] std::optional<Finding> check_header(const PageSite& site, FlipBudget& budget);
  [[nodiscard]] std::optional<Finding> check_agreement(const PageSite& site) const;
  [[nodiscard]] std::optional<Finding> check_payload(const PageSite& site, FlipBudget& budget);
  [[nodiscard]] bool has_content() const;
  void check_channels() const;
  void check_content() const;

  /// Flips the bit that a finding names, where that is wanted.
  [[nodiscard]] bool repaired(const Finding& finding, std::uint64_t page_offset);

  const InputFile& file_;
  const Survey& survey_;
  bool repair_;
  PageDecoder decoder_;
  PageHeader header_;
  std::vector<std::byte> image_;
  std::vector<std::byte> payload_;
};

}  // namespace ptc
