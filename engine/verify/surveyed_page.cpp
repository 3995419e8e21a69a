// Checks the rules of one page in the order of spec/container.md#opening, and diagnoses what breaks
// them. Each step may rely on the ones before:
//
//   level 1   read | header: magic, checksum, fields | header = directory entry
//   level 2   payload: checksum
//   level 3   payload: decodes, and its records keep their rules
//
// A fault of level 1 or 2 is damage, whose cause is looked for in the bytes; a fault of level 3
// under right checksums was written that way.
#include "engine/verify/surveyed_page.h"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include <fmt/format.h>

#include "engine/store/clauses.h"
#include "engine/verify/checked_pages.h"
#include "format/bytes.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr char kPayload[] = "spec/container.md#page-payload";
constexpr char kAgreement[] = "spec/container.md#page-agreement";

constexpr std::size_t kPayloadHashAt = 48;  // offset of the payload's checksum in the page header

/// Returns the name of a page for messages, such as "node page 3".
std::string page_name(PageType type, std::uint8_t group, std::uint32_t rank) {
  switch (type) {
    case PageType::node:
      return fmt::format("node page {}", rank);
    case PageType::point:
      return fmt::format("point page {}", rank);
    case PageType::attribute:
      return fmt::format("page {} of channel group {}", rank, group);
    case PageType::meta:
      return "the meta page";
    default:
      return fmt::format("page {} of type {}", rank, static_cast<unsigned>(type));
  }
}

/// Returns the finding that reports an error at an offset within a page.
Finding finding_in(const PageSite& site, int level, const FormatError& error) {
  const FormatError placed = error.rebased(site.entry.offset, "");
  return finding_of(site.page == kNoPage ? placed : placed.in_page(site.page), level);
}

}  // namespace

std::optional<Finding> SurveyedPage::check(const PageSite& site, int level, FlipBudget& budget) {
  // Read as much of the page as the level needs.
  const std::uint64_t offset = site.entry.offset;
  if (site.end() > file_.size()) {
    Finding finding =
        finding_in(site, 2, {kPageHeaderBytes, kPayload, "the file ends inside this page"});
    finding.cause = Cause::truncated;
    return finding;
  }
  image_.resize(level < 2 ? kPageHeaderBytes : site.end() - offset);
  try {
    file_.read_at(offset, image_);
  } catch (const std::system_error& error) {
    if (error.code().value() != EIO) throw;
    Finding finding = finding_in(site, 1, {0, kPayload, error.what()});
    finding.cause = Cause::unreadable;
    finding.bytes = image_.size();
    return finding;
  }
  // Check the header, then the payload's checksum.
  if (auto finding = check_header(site, budget)) return finding;
  if (auto finding = check_agreement(site)) return finding;
  if (level < 2) return std::nullopt;
  if (auto finding = check_payload(site, budget)) return finding;
  if (level < 3 || !has_content()) return std::nullopt;
  // Decode the payload, and check its content.
  payload_.resize(std::max<std::size_t>(payload_.size(), header_.raw_bytes));
  PageRules rules{.point_bytes = survey_.header->point_bytes, .columns = &survey_.columns};
  try {
    check_channels();
    if (survey_.container) {
      const PageNumbers::Range nodes =
          survey_.header->has_parts() ? PageNumbers::Range{} : survey_.container->node_pages();
      rules.node_pages = survey_.container->entries().subspan(nodes.first, nodes.count);
      rules.points = survey_.container->superblock().points;
    }
    decode_payload(header_, stored(), rules, payload_, decoder_);
    check_page_keys(header_, payload(), survey_.header->point_bytes);
  } catch (const FormatError& error) {
    Finding finding = finding_in(site, 3, error);
    finding.cause = Cause::writer;
    return finding;
  }
  return std::nullopt;
}

std::optional<Finding> SurveyedPage::check_header(const PageSite& site, FlipBudget& budget) {
  const auto bytes = std::span(image_).first(kPageHeaderBytes);
  try {
    header_ = decode_page_header(bytes, *survey_.header);
    return std::nullopt;
  } catch (const FormatError& error) {
    Finding finding = finding_in(site, 1, error);
    const std::string code = code_of(finding);
    const auto decode = [&] { static_cast<void>(decode_page_header(bytes, *survey_.header)); };
    // A header that is right under its checksum was written that way.
    Diagnosis seen = diagnose_sealed(bytes, decode, budget);
    if (code != "page-magic" && code != "page-checksum") seen = {Cause::writer};
    // A header whose checksum fails although the payload's holds belongs to another file: the
    // file's uuid is part of the seed of the header's checksum.
    if (code == "page-checksum" && seen.cause == Cause::unknown &&
        image_.size() > kPageHeaderBytes &&
        xxh3_64(stored().first(
            std::min<std::size_t>(stored().size(), load<std::uint32_t>(image_.data(), 12)))) ==
            load<std::uint64_t>(image_.data(), kPayloadHashAt)) {
      seen = {Cause::stale, "it is an intact page of another file"};
    }
    apply(seen, site.entry.offset, finding);
    if (!repaired(finding, site.entry.offset)) return finding;
    header_ = decode_page_header(bytes, *survey_.header);
    return std::nullopt;
  }
}

std::optional<Finding> SurveyedPage::check_agreement(const PageSite& site) const {
  const DirectoryEntry& said = site.entry;
  const bool same =
      header_.type == said.type && header_.group == said.group && header_.rank == site.rank;
  if (same && entry_of(header_, said.offset) == said) return std::nullopt;
  Finding finding =
      finding_in(site, 1, {0, kAgreement, "the page header is not what the directory says"});
  finding.cause = same ? Cause::stale : Cause::swapped;
  finding.bytes = kPageHeaderBytes + header_.stored_bytes;
  finding.expected =
      same ? "payload " + hex(said.payload_xxh3) : page_name(said.type, said.group, site.rank);
  finding.actual = same ? "payload " + hex(header_.payload_xxh3)
                        : page_name(header_.type, header_.group, header_.rank);
  return finding;
}

std::optional<Finding> SurveyedPage::check_payload(const PageSite& site, FlipBudget& budget) {
  const auto bytes = std::span(image_).subspan(kPageHeaderBytes);
  const std::uint64_t actual = xxh3_64(bytes);
  if (actual == header_.payload_xxh3) return std::nullopt;
  Finding finding =
      finding_in(site, 2, {kPageHeaderBytes, kPayload, "payload's checksum is wrong"});
  finding.bytes = bytes.size();
  finding.expected = hex(header_.payload_xxh3);
  finding.actual = hex(actual);
  const std::uint64_t offset = site.entry.offset + kPageHeaderBytes;
  apply(diagnose_payload(bytes, header_.payload_xxh3, header_.coding.codec != Codec::raw, offset,
                         budget),
        offset, finding);
  if (repaired(finding, site.entry.offset)) return std::nullopt;
  return finding;
}

bool SurveyedPage::repaired(const Finding& finding, std::uint64_t page_offset) {
  if (!repair_ || finding.cause != Cause::bit_flip) return false;
  image_[finding.offset - page_offset] ^= std::byte{1} << finding.bit;
  return true;
}

/// Returns whether the payload can be checked: values of channels whose types are lost cannot, nor
/// can pages of a later version.
bool SurveyedPage::has_content() const {
  if (is_skippable(header_.type)) return false;
  return header_.type != PageType::attribute || survey_.columns.contains(header_.group);
}

/// Checks the payload size against the channels. Readers check it when they open a file; this file
/// may be one that does not open.
void SurveyedPage::check_channels() const {
  if (header_.type != PageType::attribute) return;
  if (header_.raw_bytes ==
      header_.record_count * group_point_bytes(survey_.meta.channels, header_.group))
    return;
  throw FormatError(16, clause::kAttributePages,
                    "the payload does not have the size that its channels need");
}

}  // namespace ptc
