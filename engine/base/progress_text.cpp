// The texts of a progress report: counts, durations, lines and bars.
#include "engine/base/progress_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>

namespace ptc {
namespace {

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  std::array<char, 96> text{};
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text.data(), text.size(), pattern, arguments);
  va_end(arguments);
  return text.data();
}

double fraction(const StageState& s) {
  if (s.total == 0) return 0;
  return std::min(1.0, static_cast<double>(s.done) / static_cast<double>(s.total));
}

// Rounds down, so that 100 % is shown only when everything is done.
int percent(const StageState& s) {
  return static_cast<int>(100 * fraction(s));
}

std::string counts(const StageState& s) {
  const std::string done = format_count(static_cast<double>(s.done));
  if (s.total == 0) return done + " " + s.unit;
  return done + " of " + format_count(static_cast<double>(s.total)) + " " + s.unit;
}

std::string rate_and_time(const StageState& s) {
  const std::string rate = format_count(s.rate()) + "/s";
  if (s.total == 0) return rate + ", " + format_duration(s.elapsed_seconds);
  return rate + ", " + format_duration(s.seconds_left()) + " left";
}

}  // namespace

std::string format_count(double count) {
  constexpr std::array<const char*, 7> kUnits{"", " K", " M", " G", " T", " P", " E"};
  std::size_t unit = 0;
  // Go on to the next unit from 999.5, which would round to 1000 and four digits.
  while (count >= 999.5 && unit + 1 < kUnits.size()) {
    count /= 1000;
    ++unit;
  }
  if (unit == 0 || count >= 99.95) return format("%.0f%s", count, kUnits[unit]);
  return format(count >= 9.995 ? "%.1f%s" : "%.2f%s", count, kUnits[unit]);
}

std::string format_duration(double seconds) {
  if (!(seconds >= 0 && seconds < 360000)) return "--:--";
  const int whole = static_cast<int>(std::lround(seconds));
  const int hours = whole / 3600, minutes = whole / 60 % 60;
  if (hours == 0) return format("%d:%02d", minutes, whole % 60);
  return format("%d:%02d:%02d", hours, minutes, whole % 60);
}

double StageState::rate() const noexcept {
  return elapsed_seconds > 0 ? static_cast<double>(done) / elapsed_seconds : 0;
}

double StageState::seconds_left() const noexcept {
  if (total != 0 && done >= total) return 0;
  const double speed = rate();
  if (total == 0 || speed == 0) return std::numeric_limits<double>::infinity();
  return static_cast<double>(total - done) / speed;
}

std::string progress_line(const StageState& s) {
  const std::string share = s.total == 0 ? "" : format("%d %%, ", percent(s));
  return s.stage + ": " + share + counts(s) + ", " + rate_and_time(s);
}

std::string progress_bar(const StageState& s, std::size_t columns) {
  const std::string words = counts(s) + ", " + rate_and_time(s);
  if (s.total == 0) return (s.stage + " " + words).substr(0, columns);

  // Draw the bar in the columns that the words leave, if there are enough.
  const std::string share = format(" %3d %% ", percent(s));
  const std::size_t fixed = s.stage.size() + share.size() + words.size() + 3;  // a space, [ and ]
  constexpr std::size_t kMinBar = 5, kMaxBar = 40;
  std::string bar;
  if (columns >= fixed + kMinBar) {
    const std::size_t room = std::min(columns - fixed, kMaxBar);
    const auto full = static_cast<std::size_t>(fraction(s) * static_cast<double>(room));
    bar = " [" + std::string(full, '#') + std::string(room - full, '.') + "]";
  }
  return (s.stage + bar + share + words).substr(0, columns);
}

std::string progress_start(const StageState& s) {
  if (s.total == 0) return s.stage;
  return s.stage + ": " + format_count(static_cast<double>(s.total)) + " " + s.unit;
}

std::string progress_summary(const StageState& s) {
  const std::string count = format_count(static_cast<double>(s.done));
  const std::string time = s.elapsed_seconds < 100 ? format("%.1f s", s.elapsed_seconds)
                                                   : format_duration(s.elapsed_seconds);
  if (s.done == 0) return s.stage + ": " + time;
  return s.stage + ": " + count + " " + s.unit + " in " + time + ", " + format_count(s.rate()) +
         "/s";
}

}  // namespace ptc
