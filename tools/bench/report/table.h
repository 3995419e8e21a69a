// Tables of measurements. A kind of row has one list of columns, and JSON, CSV, aligned text and
// Markdown are all made from that list:
//
//   const Columns<Sample> columns{{"bytes", {"MiB", "{:.0f}", kMebi}, &Sample::bytes},
//                                 {"wall_seconds", {"wall s", "{:.3f}"}, &Sample::wall}};
//   markdown_of(tabulate<Sample>({"rows"}, columns, samples))
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/statistics.h"

namespace ptc::bench {

/// The content of a cell: nothing, a truth value, a count, a number, words, or the spread of
/// several runs. A number that is not finite counts as nothing: it was not measured.
using Value = std::variant<std::monostate, bool, std::uint64_t, double, std::string, Spread>;

/// A cell with any unsigned number as a count, any floating-point number as a number.
template <class T>
[[nodiscard]] Value value_of(const T& value) {
  if constexpr (std::unsigned_integral<T> && !std::same_as<T, bool>) {
    return std::uint64_t{value};
  } else if constexpr (std::floating_point<T>) {
    return static_cast<double>(value);
  } else {
    return value;
  }
}

/// A cell with the value where it was measured, else with nothing.
template <class T>
[[nodiscard]] Value when(bool measured, const T& value) {
  return measured ? value_of(value) : Value();
}

/// Units in which tables show shares and bytes.
inline constexpr double kPercent = 0.01, kMebi = 1048576, kGiga = 1e9;

/// Bytes in MiB.
[[nodiscard]] inline double mebibytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / kMebi;
}

/// How people see a column, in text and in Markdown.
struct Shown {
  std::string heading;        ///< heading with unit; empty: the column is only in JSON and CSV
  std::string format = "{}";  ///< fmt's format of a number; "{}" groups digits of counts
  double unit = 1;            ///< numbers are divided by it before they are shown
};

/// The look of a column of shares, which are shown as percentages.
[[nodiscard]] inline Shown percent(std::string heading, std::string format = "{:.2f}") {
  return {std::move(heading), std::move(format), kPercent};
}

/// Returns a function that reads a member of a member of a row.
template <class Row, class Part, class T>
[[nodiscard]] auto path(Part Row::*part, T Part::*member) {
  return [=](const Row& row) { return row.*part.*member; };
}

/// One column of a table whose rows are of type Row.
template <class Row>
struct Column {
  std::string key;  ///< name in JSON and CSV, with the unit at its end
  Shown shown;
  std::function<Value(const Row&)> get;

  /// @param getter  a member of the row or a function of the row, of a type that value_of() takes
  template <class Get>
  Column(std::string name, Shown look, Get getter)
      : key(std::move(name)),
        shown(std::move(look)),
        get([getter](const Row& row) { return value_of(std::invoke(getter, row)); }) {}
};

/// The columns of a table, in order.
template <class Row>
using Columns = std::vector<Column<Row>>;

/// What a table is called.
struct Caption {
  std::string name;     ///< member of the JSON, and TABLE of NAME-TABLE.csv
  std::string title{};  ///< stands above the table
  std::string group{};  ///< key of a column of words: text has a table for each value
};

/// A table as cells, whatever type its rows had.
struct Table {
  /// The name of a column, and how people see it.
  struct Heading {
    std::string key;
    Shown shown;
  };
  Caption caption;
  std::vector<Heading> headings;
  std::vector<std::vector<Value>> rows;  ///< each row has a cell for each heading
};

/// Makes the table of `rows`.
template <class Row>
[[nodiscard]] Table tabulate(Caption caption, const Columns<Row>& columns,
                             std::span<const Row> rows) {
  Table table{.caption = std::move(caption)};
  for (const Column<Row>& column : columns) table.headings.push_back({column.key, column.shown});
  for (const Row& row : rows) {
    std::vector<Value>& cells = table.rows.emplace_back();
    for (const Column<Row>& column : columns) cells.push_back(column.get(row));
  }
  return table;
}

/// A table as an array of objects with equal members. A spread takes three members: KEY for the
/// median, KEY_low and KEY_high. Values that were not measured are null.
[[nodiscard]] nlohmann::ordered_json json_of(const Table& table);

/// A table as CSV (RFC 4180): a line of keys and a line for each row, with the members of
/// json_of(). The cell of a value that was not measured is empty.
[[nodiscard]] std::string csv_of(const Table& table);

/// A table as text: columns as wide as their widest cell, words to the left and numbers to the
/// right. A spread is "median [minimum, maximum]", and a value that was not measured is "-". A
/// column without a value in any row is left out.
[[nodiscard]] std::string text_of(const Table& table);

/// A table as Markdown, with the cells and titles of text_of().
[[nodiscard]] std::string markdown_of(const Table& table);

}  // namespace ptc::bench
