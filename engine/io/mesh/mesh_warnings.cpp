// The warnings of a mesh file as lines of text.
#include "engine/io/mesh/mesh_warnings.h"

#include <algorithm>
#include <utility>

#include "format/text.h"

namespace ptc {
namespace {

constexpr std::size_t kParts = 4;
constexpr std::size_t kMaxBytes = 300;

// Returns a part as one line of printable text. A cut never splits a character of UTF-8.
std::string shown(std::string_view part) {
  const bool cut = part.size() > kMaxBytes;
  if (cut) {
    std::size_t end = kMaxBytes;
    while (end > 0 && (static_cast<unsigned char>(part[end]) & 0xC0) == 0x80) --end;
    part = part.substr(0, end);
  }
  std::string text;
  for (const char c : printable(part)) text += c == '\n' ? std::string("\\x0a") : std::string(1, c);
  return cut ? text + "..." : text;
}

}  // namespace

void MeshWarnings::add(const WarningKind& kind, std::string_view part) {
  auto at = std::ranges::find(kinds_, &kind, &Parts::kind);
  if (at == kinds_.end()) at = kinds_.insert(kinds_.end(), Parts{&kind});
  ++at->count;
  if (at->first.size() < kParts) at->first.push_back(shown(part));
}

std::vector<std::string> MeshWarnings::lines() const {
  std::vector<std::string> lines;
  for (const Parts& parts : kinds_) {
    std::string line(parts.kind->one);
    if (parts.count > 1)
      line = std::to_string(parts.count) + ' ' + std::string(parts.kind->several);
    for (std::size_t i = 0; i < parts.first.size(); ++i) {
      line += (i == 0 ? ": " : "; ") + parts.first[i];
    }
    if (parts.count > kParts) line += "; and " + std::to_string(parts.count - kParts) + " more";
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace ptc
