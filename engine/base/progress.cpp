// Progress reports written to a file: a bar on a terminal, plain lines elsewhere. A passing bar is
// erased at the end of its stage; any other one leaves a summary.
//
//   advance() in any thread          one thread, and only when next_report_ is due
//   done_ += count        ------->   lock, update state_, write a line, set the next report
//
// Counting costs one atomic addition and a look at the clock. A thread that finds a report due but
// the lock taken goes on: whoever holds the lock writes the report.
#include "engine/base/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <limits>
#include <mutex>
#include <string_view>
#include <utility>

#include "engine/base/progress_text.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr double kRedrawSeconds = 0.1;  // on a terminal
constexpr double kLineSeconds = 10;     // elsewhere

// Writes a text, or gives up silently: a report that cannot be written must not stop the work.
void write_text(int fd, std::string_view text) noexcept {
  while (!text.empty()) {
    const ssize_t n = ::write(fd, text.data(), text.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(n));
  }
}

std::string note_line(const std::string& text) {
  return std::string(program_invocation_short_name) + ": " + printable(text) + '\n';
}

class StderrNotes final : public Progress {
 public:
  void note(const std::string& text) override { write_text(STDERR_FILENO, note_line(text)); }
};

class FileProgress final : public Progress {
 public:
  FileProgress(int fd, ReportStyle style, Clock clock)
      : fd_(fd),
        terminal_(style != ReportStyle::lines),
        passing_(style == ReportStyle::passing_bar),
        clock_(std::move(clock)) {}

  // Ends the line of a stage that an exception has left, so that the error message starts on a line
  // of its own.
  ~FileProgress() override {
    if (running_ && terminal_) passing_ ? redraw("") : write("\n");
  }

  void begin(const std::string& stage, std::uint64_t total, const std::string& unit) override {
    end();
    const std::lock_guard lock(mutex_);
    state_ = {stage, unit, total, 0, 0};
    done_ = 0;
    start_ = clock_();
    running_ = true;
    if (!terminal_) write(progress_start(state_) + '\n');
    next_report_ = start_ + interval();
  }

  void note(const std::string& text) override {
    end();
    const std::lock_guard lock(mutex_);
    write(note_line(text));
  }

  // Counts; when a report is due, one thread writes it while the others go on.
  void advance(std::uint64_t count) override {
    done_.fetch_add(count, std::memory_order_relaxed);
    if (clock_() < next_report_.load(std::memory_order_relaxed)) return;
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || !running_) return;
    const double now = clock_();
    if (now < next_report_) return;
    next_report_ = now + interval();
    const StageState& state = update(now);
    terminal_ ? redraw(progress_bar(state, columns())) : write(progress_line(state) + '\n');
  }

  void end() override {
    const std::lock_guard lock(mutex_);
    if (!running_) return;
    running_ = false;
    next_report_ = std::numeric_limits<double>::infinity();
    const std::string summary = progress_summary(update(clock_()));
    if (terminal_) redraw(passing_ ? "" : summary);
    if (!passing_) write(terminal_ ? "\n" : summary + '\n');
  }

 private:
  [[nodiscard]] double interval() const noexcept {
    return terminal_ ? kRedrawSeconds : kLineSeconds;
  }

  const StageState& update(double now) {
    state_.done = done_.load(std::memory_order_relaxed);
    state_.elapsed_seconds = now - start_;
    return state_;
  }

  // Leaves one column free, because a line as wide as the terminal wraps on some terminals.
  [[nodiscard]] std::size_t columns() const noexcept {
    winsize size{};
    if (ioctl(fd_, TIOCGWINSZ, &size) != 0 || size.ws_col < 2) return 79;
    return size.ws_col - 1u;
  }

  // Replaces the line on the terminal and erases what is left of the old one.
  void redraw(const std::string& text) const {
    std::string line = "\r";
    line.append(text).append("\x1b[K");
    write(line);
  }

  void write(std::string_view text) const noexcept { write_text(fd_, text); }

  const int fd_;
  const bool terminal_;
  const bool passing_;  // the bar is erased when its stage ends
  const Clock clock_;
  std::atomic<std::uint64_t> done_{0};
  std::atomic<double> next_report_{std::numeric_limits<double>::infinity()};
  std::mutex mutex_;  // guards the members below
  StageState state_;
  double start_ = 0;
  bool running_ = false;
};

double steady_seconds() {
  using std::chrono::steady_clock;
  return std::chrono::duration<double>(steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::unique_ptr<Progress> make_progress(int fd, ReportStyle style, Clock clock) {
  return std::make_unique<FileProgress>(fd, style, std::move(clock));
}

std::unique_ptr<Progress> make_stderr_progress() {
  const bool terminal = isatty(STDERR_FILENO) == 1;
  return make_progress(STDERR_FILENO, terminal ? ReportStyle::bar : ReportStyle::lines,
                       steady_seconds);
}

std::unique_ptr<Progress> make_stderr_bar() {
  if (isatty(STDERR_FILENO) != 1) return make_stderr_notes();
  return make_progress(STDERR_FILENO, ReportStyle::passing_bar, steady_seconds);
}

std::unique_ptr<Progress> make_stderr_notes() {
  return std::make_unique<StderrNotes>();
}

}  // namespace ptc
