// Draws the map of ptcverify --map: the file from its first byte to its last, as rows of squares.
//
//   scene.ptcx: damaged                          title
//   12.3 MB in 190 pages, 1 of them damaged      subtitle
//      0x0  HPPPPPPPPPPPPPPPPPPPPPPPP            one square: bytes() bytes, a multiple of a sector
//   0x6000  PPPPNNNNNNNNNNNNXXNNNNNNN            its colour: the kind of page that lies there
//  0x12000  NNNNNNAAAAAAAAAAAAAAMDDDD            X: damaged, whatever lies there
//   [] points  [] nodes  [] attributes ...       legend
//   offset 2335808: page 190: ...                the first findings
//
// At most kMaxRows rows are drawn: in a larger file a square stands for more sectors. A square with
// several kinds shows the last of them in the order of Kind, so damage is never hidden.
#include "tools/damage_map.h"

#include <algorithm>
#include <array>
#include <vector>

#include <fmt/format.h>

#include "tools/bench/chart/picture.h"
#include "tools/report.h"

namespace ptc {
namespace {

enum class Kind : std::uint8_t { nothing, points, nodes, attributes, meta, structure, damage };

struct KindStyle {
  const char* name;
  Colour colour;
};

constexpr std::array kStyles{
    KindStyle{"padding or unknown", {0.88, 0.88, 0.88}},
    KindStyle{"points", {0.45, 0.67, 0.85}},
    KindStyle{"nodes", {0.55, 0.76, 0.55}},
    KindStyle{"attributes", {0.75, 0.65, 0.85}},
    KindStyle{"meta page", {0.95, 0.80, 0.45}},
    KindStyle{"header, directory, superblocks", {0.35, 0.40, 0.50}},
    KindStyle{"damaged", {0.85, 0.10, 0.12}},
};

constexpr std::uint64_t kColumns = 96;
constexpr std::uint64_t kMaxRows = 40;
constexpr double kCell = 8, kLeft = 96, kTop = 52, kMargin = 16, kLine = 14;
constexpr std::size_t kMaxLines = 16;
constexpr std::size_t kMaxLetters = 150;

Kind kind_of(PageType type) {
  switch (type) {
    case PageType::point:
      return Kind::points;
    case PageType::node:
      return Kind::nodes;
    case PageType::attribute:
      return Kind::attributes;
    case PageType::meta:
      return Kind::meta;
    case PageType::directory:
    case PageType::parts:
      return Kind::structure;
  }
  return Kind::nothing;
}

/// A file in equal parts, the squares of the map, each with the kind of page that it holds.
class Parts {
 public:
  explicit Parts(const VerifyReport& report) : file_bytes_(report.file_bytes) {
    const std::uint64_t sectors = file_bytes_ / kSectorBytes + 1;
    bytes_ = (sectors + kColumns * kMaxRows - 1) / (kColumns * kMaxRows) * kSectorBytes;
    kinds_.resize((file_bytes_ + bytes_ - 1) / bytes_, Kind::nothing);
    for (const PageSite& site : report.sites)
      mark(site.entry.offset, site.end(), kind_of(site.entry.type));
    mark(0, kBlockBytes, Kind::structure);
    if (report.superblock)
      mark(report.superblock->directory_offset, report.superblock->file_bytes, Kind::structure);
    for (const PageSite& site : report.sites) {
      if (!site.sound) mark(site.entry.offset, site.end(), Kind::damage);
    }
    for (const Finding& finding : report.findings) {
      if (finding.severity == Severity::damage)
        mark(finding.offset, finding.offset + std::max<std::uint64_t>(1, finding.bytes),
             Kind::damage);
    }
  }

  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] const std::vector<Kind>& kinds() const noexcept { return kinds_; }
  [[nodiscard]] std::uint64_t rows() const noexcept {
    return (kinds_.size() + kColumns - 1) / kColumns;
  }

 private:
  /// Gives a kind to the parts that hold bytes from `begin` to `end`, unless they have a later
  /// kind.
  void mark(std::uint64_t begin, std::uint64_t end, Kind kind) {
    // A finding on the end of a file lies behind its last byte: it marks the last part.
    begin = std::min(begin, file_bytes_ > 0 ? file_bytes_ - 1 : 0);
    end = std::clamp(end, begin + 1, std::max(begin + 1, file_bytes_));
    for (std::uint64_t part = begin / bytes_; part <= (end - 1) / bytes_ && part < kinds_.size();
         ++part) {
      kinds_[part] = std::max(kinds_[part], kind);
    }
  }

  std::uint64_t file_bytes_;
  std::uint64_t bytes_ = 0;  ///< size of a part
  std::vector<Kind> kinds_;
};

/// At most kMaxLetters bytes of a text, with dots behind it when some are left out.
std::string shortened(std::string text) {
  if (text.size() <= kMaxLetters) return text;
  std::size_t end = kMaxLetters;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80)
    --end;  // cut between letters of UTF-8
  return text.substr(0, end) + "...";
}

/// The first findings, a line each, and the number of the others.
std::vector<std::string> lines_of(const VerifyReport& report) {
  std::vector<std::string> lines;
  for (const Finding& finding : report.findings) {
    if (lines.size() == kMaxLines) break;
    lines.push_back(shortened(line_of(finding)));
  }
  const std::uint64_t rest = report.damage + report.warnings - lines.size();
  if (rest > 0) lines.push_back(fmt::format("and {} more", rest));
  return lines;
}

void draw_cells(Canvas& canvas, const Parts& parts) {
  for (std::uint64_t i = 0; i < parts.kinds().size(); ++i) {
    const double left = kLeft + kCell * static_cast<double>(i % kColumns);
    const double top = kTop + kCell * static_cast<double>(i / kColumns);
    const KindStyle& style = kStyles[static_cast<std::size_t>(parts.kinds()[i])];
    canvas.fill({left, top, left + kCell - 1, top + kCell - 1}, style.colour);
  }
  for (std::uint64_t row = 0; row < parts.rows(); row += 4) {
    canvas.text({kLeft - 6, kTop + kCell * static_cast<double>(row + 1) - 1},
                fmt::format("{:#x}", row * kColumns * parts.bytes()),
                {.size = 9, .align = Align::right});
  }
}

void draw_legend(Canvas& canvas, double top) {
  double left = kLeft;
  for (const KindStyle& style : kStyles) {
    canvas.fill({left, top - 8, left + 9, top + 1}, style.colour);
    canvas.text({left + 13, top}, style.name, {.size = 10});
    left += 13 + canvas.text_width(style.name, {.size = 10}) + 16;
  }
}

}  // namespace

void write_damage_map(const std::filesystem::path& target, const std::string& name,
                      const VerifyReport& report) {
  const Parts parts(report);
  const std::vector<std::string> lines = lines_of(report);

  // Lay out: title, squares, legend, findings.
  const double legend = kTop + kCell * static_cast<double>(parts.rows()) + 22;
  Picture picture;
  picture.width = kLeft + kCell * static_cast<double>(kColumns) + kMargin;
  picture.height = legend + kLine * static_cast<double>(lines.size()) + kMargin + 8;
  picture.title = fmt::format("{}: {}", name, report.sound() ? "sound" : "damaged");
  for (const std::string& line : lines) picture.description += line + "\n";

  // Draw from top to bottom.
  picture.draw = [&](Canvas& canvas) {
    canvas.fill({0, 0, picture.width, picture.height}, {1, 1, 1});
    canvas.text({kMargin, 22}, shortened(picture.title), {.size = 13, .bold = true});
    canvas.text({kMargin, 40},
                fmt::format("{}{}; each square is {} bytes", bytes_text(report.file_bytes),
                            report.pages ? fmt::format(" in {} pages, {} of them damaged",
                                                       *report.pages, *report.damaged_pages)
                                         : std::string(),
                            parts.bytes()),
                {.size = 10});
    draw_cells(canvas, parts);
    draw_legend(canvas, legend);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      canvas.text({kMargin, legend + 8 + kLine * static_cast<double>(i + 1)}, lines[i],
                  {.size = 10});
    }
  };
  write_picture(target, picture);
}

}  // namespace ptc
