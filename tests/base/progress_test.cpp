// The lines of a progress report, and when they appear.
#include "engine/base/progress.h"

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/progress_text.h"

using namespace ptc;

namespace {

// The file that a report is written to, and the clock that it reads.
struct Desk {
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file{std::tmpfile(), std::fclose};
  double now = 1000;

  std::unique_ptr<Progress> progress(ReportStyle style) {
    REQUIRE(file != nullptr);
    return make_progress(fileno(file.get()), style, [this] { return now; });
  }

  // Returns what was written since the last call.
  std::string take() {
    std::string text(1 << 16, '\0');
    const ssize_t n = pread(fileno(file.get()), text.data(), text.size(), read_);
    REQUIRE(n >= 0);
    read_ += n;
    text.resize(static_cast<std::size_t>(n));
    return text;
  }

 private:
  off_t read_ = 0;
};

}  // namespace

TEST_CASE("progress: a note shows the control characters of a name as text", "[base][progress]") {
  for (const ReportStyle style : {ReportStyle::lines, ReportStyle::bar}) {
    Desk desk;
    desk.progress(style)->note("sky\x1b[2J\xff.exr has changed");
    CHECK_THAT(desk.take(), Catch::EndsWith(": sky\\x1b[2J\\xff.exr has changed\n"));
  }
}

TEST_CASE("progress: a note is a line of its own, even on a terminal", "[base][progress]") {
  for (const ReportStyle style : {ReportStyle::lines, ReportStyle::bar}) {
    Desk desk;
    const auto progress = desk.progress(style);
    progress->note("12.0 GB of temporary files");
    CHECK(desk.take() ==
          std::string(program_invocation_short_name) + ": 12.0 GB of temporary files\n");
    progress->begin("sort", 10, "points");
    desk.take();
    progress->note("more");  // after the line of the stage
    const std::string told = desk.take();
    CHECK(told.ends_with(std::string("\n") + program_invocation_short_name + ": more\n"));
  }
}

TEST_CASE("progress: a count has three digits and a unit", "[base][progress]") {
  CHECK(format_count(0) == "0");
  CHECK(format_count(7) == "7");
  CHECK(format_count(999) == "999");
  CHECK(format_count(999.4) == "999");
  CHECK(format_count(999.5) == "1.00 K");
  CHECK(format_count(1000) == "1.00 K");
  CHECK(format_count(9994) == "9.99 K");
  CHECK(format_count(9995) == "10.0 K");
  CHECK(format_count(99949) == "99.9 K");
  CHECK(format_count(99950) == "100 K");
  CHECK(format_count(999499) == "999 K");
  CHECK(format_count(999500) == "1.00 M");
  CHECK(format_count(27.1e6) == "27.1 M");
  CHECK(format_count(1e9) == "1.00 G");
  CHECK(format_count(1.8446744073709552e19) == "18.4 E");
}

TEST_CASE("progress: a duration is minutes and seconds, and hours where needed",
          "[base][progress]") {
  CHECK(format_duration(0) == "0:00");
  CHECK(format_duration(7.4) == "0:07");
  CHECK(format_duration(59.6) == "1:00");
  CHECK(format_duration(754) == "12:34");
  CHECK(format_duration(3599) == "59:59");
  CHECK(format_duration(3599.7) == "1:00:00");
  CHECK(format_duration(3723) == "1:02:03");
  CHECK(format_duration(359999) == "99:59:59");
  for (const double odd : {360000.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    CHECK(format_duration(odd) == "--:--");
}

TEST_CASE("progress: rate and time left follow from the work done", "[base][progress]") {
  StageState s{"sort", "points", 100, 25, 5};
  CHECK(s.rate() == 5);
  CHECK(s.seconds_left() == 15);
  s.done = 100;
  CHECK(s.seconds_left() == 0);
  s.done = 130;  // more than announced
  CHECK(s.seconds_left() == 0);
  s.done = 0;
  CHECK(s.rate() == 0);
  CHECK(std::isinf(s.seconds_left()));
  s = {"sort", "points", 0, 25, 5};
  CHECK(std::isinf(s.seconds_left()));
  s = {"sort", "points", 100, 25, 0};
  CHECK(s.rate() == 0);
}

TEST_CASE("progress: the lines say share, counts, rate and time", "[base][progress]") {
  const StageState known{"sort", "points", 27'100'000, 12'300'000, 3};
  CHECK(progress_line(known) == "sort: 45 %, 12.3 M of 27.1 M points, 4.10 M/s, 0:04 left");
  const StageState unknown{"read", "points", 0, 5000, 61};
  CHECK(progress_line(unknown) == "read: 5.00 K points, 82/s, 1:01");
  CHECK(progress_summary(known) == "sort: 12.3 M points in 3.0 s, 4.10 M/s");
  CHECK(progress_summary({"sort", "points", 0, 1000, 100}) == "sort: 1.00 K points in 1:40, 10/s");
  // The share is below 100 % before the end, and never above.
  CHECK(progress_line({"s", "p", 1000, 999, 1}).starts_with("s: 99 %"));
  CHECK(progress_line({"s", "p", 1000, 2000, 1}).starts_with("s: 100 %"));
}

TEST_CASE("progress: a bar fits the columns it is given", "[base][progress]") {
  const StageState half{"sort", "points", 100, 50, 1};
  CHECK(progress_bar(half, 80) ==
        "sort [################.................]  50 % 50 of 100 points, 50/s, 0:01 left");
  CHECK(progress_bar(half, 52) == "sort [##...]  50 % 50 of 100 points, 50/s, 0:01 left");
  CHECK(progress_bar(half, 51) == "sort  50 % 50 of 100 points, 50/s, 0:01 left");
  for (const std::uint64_t total : {0u, 100u})
    for (std::size_t columns = 0; columns < 300; ++columns)
      for (const std::uint64_t done : {0u, 1u, 50u, 99u, 100u, 200u}) {
        const std::string bar = progress_bar({"stage", "points", total, done, 1}, columns);
        CHECK(bar.size() <= columns);
      }
}

TEST_CASE("progress: without a terminal a stage prints its start, its end and a line every 10 s",
          "[base][progress]") {
  Desk desk;
  const auto progress = desk.progress(ReportStyle::lines);
  progress->begin("sort", 1000, "points");
  CHECK(desk.take() == "sort: 1.00 K points\n");
  desk.now += 9.9;
  progress->advance(100);
  CHECK(desk.take().empty());
  desk.now += 0.1;
  progress->advance(100);
  CHECK(desk.take() == "sort: 20 %, 200 of 1.00 K points, 20/s, 0:40 left\n");
  desk.now += 9.9;
  progress->advance(0);
  CHECK(desk.take().empty());
  desk.now += 5.1;
  progress->advance(800);
  CHECK(desk.take() == "sort: 100 %, 1.00 K of 1.00 K points, 40/s, 0:00 left\n");
  progress->end();
  CHECK(desk.take() == "sort: 1.00 K points in 25.0 s, 40/s\n");
  desk.now += 100;
  progress->end();
  progress->advance(1);
  CHECK(desk.take().empty());

  progress->begin("read", 0, "points");  // counts start again
  CHECK(desk.take() == "read\n");
  desk.now += 2;
  progress->advance(4);
  progress->begin("build", 0, "nodes");  // ends the previous stage
  CHECK(desk.take() == "read: 4 points in 2.0 s, 2/s\nbuild\n");
  desk.now += 0.5;
  progress->end();  // a stage that counted nothing has a time and no rate
  CHECK(desk.take() == "build: 0.5 s\n");
}

TEST_CASE("progress: the bar on a terminal is redrawn at most 10 times a second",
          "[base][progress]") {
  Desk desk;
  {
    const auto progress = desk.progress(ReportStyle::bar);
    progress->begin("sort", 100, "points");
    desk.now += 0.09;
    progress->advance(1);
    CHECK(desk.take().empty());
    std::size_t drawn = 0;
    for (int i = 0; i < 1000; ++i) {  // one second
      desk.now += 0.001;
      progress->advance(0);
      drawn += !desk.take().empty();
    }
    CHECK(drawn >= 9);
    CHECK(drawn <= 11);
    desk.now = 1002;
    progress->advance(49);
    CHECK(
        desk.take() ==
        "\rsort [################................]  50 % 50 of 100 points, 25/s, 0:02 left\x1b[K");
    progress->advance(50);
    progress->end();
    CHECK(desk.take() == "\rsort: 100 points in 2.0 s, 50/s\x1b[K\n");
    progress->begin("build", 0, "nodes");
  }
  CHECK(desk.take() == "\n");  // left in the middle of a stage
}

TEST_CASE("progress: a passing bar leaves notes and nothing else on the terminal",
          "[base][progress]") {
  Desk desk;
  {
    const auto progress = desk.progress(ReportStyle::passing_bar);
    progress->begin("sort", 100, "points");
    desk.now += 1;
    progress->advance(50);
    CHECK(
        desk.take() ==
        "\rsort [################................]  50 % 50 of 100 points, 50/s, 0:01 left\x1b[K");
    progress->end();
    CHECK(desk.take() == "\r\x1b[K");
    progress->begin("build", 0, "nodes");
    progress->note("more");
    CHECK(desk.take() == std::string("\r\x1b[K") + program_invocation_short_name + ": more\n");
    progress->begin("build", 0, "nodes");
  }
  CHECK(desk.take() == "\r\x1b[K");  // left in the middle of a stage
}

TEST_CASE("progress: advances from many threads add up", "[base][progress]") {
  Desk desk;
  const auto progress = desk.progress(ReportStyle::bar);
  progress->begin("sort", 0, "points");
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 20000; ++i) progress->advance(3);
    });
  for (std::thread& t : threads) t.join();
  desk.now += 1;
  progress->end();
  CHECK(desk.take() == "\rsort: 240 K points in 1.0 s, 240 K/s\x1b[K\n");
}

TEST_CASE("progress: a report that cannot be written stops nothing", "[base][progress]") {
  const auto progress =
      make_progress(-1, ReportStyle::lines, [now = 0.0]() mutable { return now += 20; });
  CHECK_NOTHROW(progress->begin("sort", 1, "points"));
  CHECK_NOTHROW(progress->advance(1));
  CHECK_NOTHROW(progress->end());
}

TEST_CASE("progress: the base class is silent", "[base][progress]") {
  Progress progress;
  CHECK_NOTHROW(progress.begin("sort", 1, "points"));
  CHECK_NOTHROW(progress.advance(1));
  CHECK_NOTHROW(progress.end());
  CHECK(make_stderr_progress() != nullptr);
  CHECK(make_stderr_bar() != nullptr);
}
