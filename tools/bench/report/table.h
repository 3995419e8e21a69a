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

/// A cell: nothing, a truth, a count, a number, words, or what several runs gave. A number that is
/// not finite counts as nothing: it was not measured.
using Value = std::variant<std::monostate, bool, std::uint64_t, double, std::string, Spread>;

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

/// A value where there is one, else nothing.
template <class T>
[[nodiscard]] Value when(bool measured, const T& value) {
  return measured ? value_of(value) : Value();
}

/// Units in which people read shares and bytes.
inline constexpr double kPercent = 0.01, kMebi = 1048576, kGiga = 1e9;

/// How a column looks to people.
struct Shown {
  std::string heading;        ///< with the unit; empty: the column is in JSON and CSV alone
  std::string format = "{}";  ///< of fmt for one number; "{}" groups the digits of a count by three
  double unit = 1;            ///< numbers are divided by it
};

/// Of shares.
[[nodiscard]] inline Shown percent(std::string heading, std::string format = "{:.2f}") {
  return {std::move(heading), std::move(format), kPercent};
}

/// What a member of a member holds.
template <class Row, class Part, class T>
[[nodiscard]] auto path(Part Row::*part, T Part::*member) {
  return [=](const Row& row) { return row.*part.*member; };
}

/// One column of rows of a kind.
template <class Row>
struct Column {
  std::string key;  ///< of JSON and CSV, with the unit at its end
  Shown shown;
  std::function<Value(const Row&)> get;

  /// @param get  a member of the row, or a function of it, of a type that value_of() takes
  template <class Get>
  Column(std::string name, Shown look, Get getter)
      : key(std::move(name)),
        shown(std::move(look)),
        get([getter](const Row& row) { return value_of(std::invoke(getter, row)); }) {}
};

template <class Row>
using Columns = std::vector<Column<Row>>;

/// What a table is called.
struct Caption {
  std::string name;     ///< member of the JSON, and part of the CSV file's name
  std::string title{};  ///< over the table for people
  std::string group{};  ///< key of a column of words: people get a table for each of its values
};

/// Rows as cells.
struct Table {
  struct Heading {
    std::string key;
    Shown shown;
  };
  Caption caption;
  std::vector<Heading> headings;
  std::vector<std::vector<Value>> rows;  ///< each with a cell for each heading
};

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

/// An array of objects with equal members. Several runs are three members: KEY for the median,
/// KEY_low and KEY_high. What was not measured is null.
[[nodiscard]] nlohmann::ordered_json json_of(const Table& table);

/// A line of keys and a line for each row (RFC 4180), with the same members as json_of(). A cell of
/// what was not measured is empty.
[[nodiscard]] std::string csv_of(const Table& table);

/// Columns as wide as their widest cell, words to the left and numbers to the right. Several runs
/// are "median [least, greatest]"; what was not measured is "-". A column without a value in any
/// row is left out.
[[nodiscard]] std::string text_of(const Table& table);

/// The same as a table of Markdown.
[[nodiscard]] std::string markdown_of(const Table& table);

}  // namespace ptc::bench
