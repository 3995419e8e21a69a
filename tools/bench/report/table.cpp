// From cells to four kinds of text. People see a part for each value of the grouping column, and no
// column that is empty in that part; programs see everything:
//
//   scene  method  s            ### fractal           ### city
//   fractal  a     1            | method | s |        | method | s |
//   fractal  b     2     ->     | a      | 1 |        | a      | 3 |
//   city     a     3            | b      | 2 |
#include "tools/bench/report/table.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

/// One function for each alternative of a variant.
template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};

bool is_present(const Value& value) {
  return std::visit(Overloaded{[](std::monostate) { return false; },
                               [](double number) { return std::isfinite(number); },
                               [](const Spread& spread) { return std::isfinite(spread.median); },
                               [](const auto&) { return true; }},
                    value);
}

Json json_of(const Value& value) {
  if (!is_present(value)) return nullptr;
  return std::visit(Overloaded{[](std::monostate) { return Json(nullptr); },
                               [](const Spread& spread) { return Json(spread.median); },
                               [](const auto& plain) { return Json(plain); }},
                    value);
}

/// Whether a column holds spreads: then each of its cells takes three members.
bool has_runs(const Table& table, std::size_t column) {
  return std::ranges::any_of(table.rows, [&](const std::vector<Value>& row) {
    return std::holds_alternative<Spread>(row[column]);
  });
}

/// A count with its digits in groups of three: "12,345,678".
std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t at = digits.size(); at > 3;) digits.insert(at -= 3, ",");
  return digits;
}

std::string number_text(double number, const Shown& shown) {
  return fmt::format(fmt::runtime(shown.format), number / shown.unit);
}

std::string text_of(const Value& value, const Shown& shown) {
  if (!is_present(value)) return "-";
  const auto number = [&](double plain) { return number_text(plain, shown); };
  return std::visit(Overloaded{[](std::monostate) { return std::string(); },
                               [](bool truth) { return std::string(truth ? "yes" : "no"); },
                               [&](std::uint64_t count) {
                                 const bool plain = shown.unit == 1 && shown.format == "{}";
                                 return plain ? grouped(count) : number(static_cast<double>(count));
                               },
                               [&](double plain) { return number(plain); },
                               [](const std::string& words) { return words; },
                               [&](const Spread& s) {
                                 if (s.low == s.high) return number(s.median);
                                 return fmt::format("{} [{}, {}]", number(s.median), number(s.low),
                                                    number(s.high));
                               }},
                    value);
}

/// The part of a table that belongs to one value of the grouping column, as people see it.
struct Part {
  std::string title;
  std::vector<std::string> headings;
  std::vector<bool> words;  ///< whether a column has words rather than numbers
  std::vector<std::vector<std::string>> rows;
};

std::string title_of(const Table& table, const std::string& group) {
  if (group.empty() || table.caption.title.empty()) return table.caption.title + group;
  return table.caption.title + ": " + group;
}

/// Makes a part of the columns that have a heading and a value in at least one of these rows.
Part part_of(const Table& table, const std::vector<const std::vector<Value>*>& rows,
             const std::string& group) {
  Part part{.title = title_of(table, group),
            .rows = std::vector<std::vector<std::string>>(rows.size())};
  for (std::size_t column = 0; column < table.headings.size(); ++column) {
    const Table::Heading& heading = table.headings[column];
    const bool valued = std::ranges::any_of(
        rows, [&](const std::vector<Value>* row) { return is_present((*row)[column]); });
    if (heading.shown.heading.empty() || heading.key == table.caption.group || !valued) continue;
    part.headings.push_back(heading.shown.heading);
    part.words.push_back(std::ranges::any_of(rows, [&](const std::vector<Value>* row) {
      return std::holds_alternative<std::string>((*row)[column]);
    }));
    for (std::size_t i = 0; i < rows.size(); ++i)
      part.rows[i].push_back(text_of((*rows[i])[column], heading.shown));
  }
  return part;
}

/// Makes one part for each value of the grouping column, in the order of first appearance.
std::vector<Part> parts_of(const Table& table) {
  const auto key = std::ranges::find(table.headings, table.caption.group, &Table::Heading::key);
  const auto column = static_cast<std::size_t>(key - table.headings.begin());
  const bool grouped = key != table.headings.end();
  std::vector<std::pair<std::string, std::vector<const std::vector<Value>*>>> groups;
  for (const std::vector<Value>& row : table.rows) {
    const std::string name = grouped ? std::get<std::string>(row[column]) : "";
    auto group = std::ranges::find(groups, name, [](const auto& g) { return g.first; });
    if (group == groups.end()) group = groups.insert(groups.end(), {name, {}});
    group->second.push_back(&row);
  }
  std::vector<Part> parts;
  for (const auto& [name, rows] : groups) {
    Part part = part_of(table, rows, name);
    if (!part.headings.empty()) parts.push_back(std::move(part));
  }
  return parts;
}

/// The number of characters of a UTF-8 text.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

/// A cell of a CSV file: empty for null, words in quotes.
std::string csv_cell(const Json& value) {
  if (value.is_null()) return {};
  if (!value.is_string()) return value.dump();
  std::string cell = "\"";
  for (const char c : value.get_ref<const std::string&>())
    cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  return cell + '"';
}

/// A cell of Markdown, with its vertical bars escaped so that it does not end early.
std::string markdown_cell(const std::string& text) {
  std::string cell;
  for (const char c : text) cell += c == '|' ? std::string("\\|") : std::string(1, c);
  return cell;
}

std::string markdown_line(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + markdown_cell(cell) + " |";
  return line + "\n";
}

}  // namespace

Json json_of(const Table& table) {
  Json list = Json::array();
  for (const std::vector<Value>& row : table.rows) {
    Json& members = list.emplace_back(Json::object());
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string& key = table.headings[i].key;
      members[key] = json_of(row[i]);
      if (!has_runs(table, i)) continue;
      const Spread* runs = is_present(row[i]) ? std::get_if<Spread>(&row[i]) : nullptr;
      members[key + "_low"] = runs ? Json(runs->low) : Json(nullptr);
      members[key + "_high"] = runs ? Json(runs->high) : Json(nullptr);
    }
  }
  return list;
}

std::string csv_of(const Table& table) {
  const Json rows = json_of(table);
  if (rows.empty()) return {};
  std::string text;
  for (const auto& [key, value] : rows.front().items()) text += (text.empty() ? "" : ",") + key;
  for (const Json& row : rows) {
    std::string separator = "\n";
    for (const auto& [key, value] : row.items())
      text += std::exchange(separator, ",") + csv_cell(value);
  }
  return text + "\n";
}

std::string text_of(const Table& table) {
  std::string text;
  for (const Part& part : parts_of(table)) {
    if (!text.empty()) text += "\n";
    if (!part.title.empty()) text += part.title + "\n";
    // Measure the columns
    std::vector<std::vector<std::string>> lines{part.headings};
    lines.insert(lines.end(), part.rows.begin(), part.rows.end());
    std::vector<std::size_t> widths(part.headings.size());
    for (const auto& line : lines) {
      for (std::size_t i = 0; i < line.size(); ++i)
        widths[i] = std::max(widths[i], width_of(line[i]));
    }
    // Pad the cells, words on the right and numbers on the left
    for (const auto& line : lines) {
      std::string words;
      for (std::size_t i = 0; i < line.size(); ++i) {
        const std::string blanks(widths[i] - width_of(line[i]), ' ');
        words += (i > 0 ? "  " : "") + (part.words[i] ? line[i] + blanks : blanks + line[i]);
      }
      text += words.substr(0, words.find_last_not_of(' ') + 1) + "\n";
    }
  }
  return text;
}

std::string markdown_of(const Table& table) {
  std::string text;
  for (const Part& part : parts_of(table)) {
    if (!text.empty()) text += "\n";
    if (!part.title.empty()) text += "### " + part.title + "\n\n";
    text += markdown_line(part.headings) + "|";
    for (const bool words : part.words) text += words ? "---|" : "---:|";
    text += "\n";
    for (const auto& row : part.rows) text += markdown_line(row);
  }
  return text;
}

}  // namespace ptc::bench
