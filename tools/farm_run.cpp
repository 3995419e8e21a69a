#include "tools/farm_run.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <map>
#include <system_error>
#include <thread>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/text_file.h"
#include "engine/pipeline/farm/tasks.h"
#include "tools/common.h"
#include "tools/farm_retry.h"
#include "tools/farm_status.h"

namespace ptc {
namespace {

/// Replaces a child process by a task. It ends with its parent, also when that is killed.
/// @param parent  number of the process that has started this one
/// Called between fork() and exec(): only what a signal handler may call.
[[noreturn]] void become(char* const* arguments, const char* log, pid_t parent) noexcept {
  const int errors = ::open(log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const bool set = errors >= 0 && nothing >= 0 && ::dup2(nothing, STDIN_FILENO) >= 0 &&
                   ::dup2(errors, STDOUT_FILENO) >= 0 && ::dup2(errors, STDERR_FILENO) >= 0 &&
                   ::prctl(PR_SET_PDEATHSIG, SIGTERM) == 0;
  if (set && ::getppid() == parent) ::execv(arguments[0], arguments);
  ::_exit(kSystem);
}

/// The processes of a run.
class Runner {
 public:
  Runner(const FarmPlan& plan, const RunOptions& run, Progress& progress)
      : plan_(plan),
        memory_bytes_(run.memory_bytes),
        cores_(run.threads > 0 ? run.threads : std::max(1U, std::thread::hardware_concurrency())),
        progress_(progress) {
    for (const FarmTask& task : plan.tasks) {
      ++counts_[task.step];
      if (task.memory_bytes > memory_bytes_) {
        throw LimitError(fmt::format("{} takes up to {} bytes: the least cap is {}", task.name(),
                                     task.memory_bytes, task.memory_bytes));
      }
    }
  }

  FarmRun run() {
    std::filesystem::create_directories(plan_.folder() / "log");
    note_begin(plan_);
    progress_.begin("run", plan_.tasks.size(), "tasks");
    TaskMarks marks(plan_);
    for (const FarmTask& task : plan_.tasks) {
      if (!marks.is_done(task)) {
        waiting_.push_back(&task);
        continue;
      }
      ++done_[task.step];
      ++result_.skipped;
      progress_.advance(1);
    }
    while (start_ready() || !running_.empty()) await_one();
    if (result_.failed.empty()) remove_spent(plan_);
    progress_.end();
    return std::move(result_);
  }

 private:
  /// Starts all tasks that may run and fit. @return whether one was started
  bool start_ready() {
    if (!result_.failed.empty()) return false;
    const TaskStep step = next_step();
    bool started = false;
    for (auto at = waiting_.begin(); at != waiting_.end();) {
      const FarmTask& task = **at;
      if (task.step != step || running_.size() >= cores_ ||
          used_bytes_ + task.memory_bytes > memory_bytes_) {
        ++at;
        continue;
      }
      start(task);
      at = waiting_.erase(at);
      started = true;
    }
    return started;
  }

  /// Returns the first step that is not done: each needs all before it, also when one that was done
  /// has lost a file.
  [[nodiscard]] TaskStep next_step() {
    for (const FarmTask& task : plan_.tasks) {
      if (done_[task.step] < counts_[task.step]) return task.step;
    }
    return plan_.tasks.back().step;
  }

  /// Returns how many of the tasks that may run now run beside each other.
  [[nodiscard]] unsigned at_once(const FarmTask& task) const {
    const std::uint64_t same = counts_.at(task.step);
    const std::uint64_t fit =
        std::max<std::uint64_t>(memory_bytes_ / std::max<std::uint64_t>(task.memory_bytes, 1), 1);
    return static_cast<unsigned>(std::min<std::uint64_t>({same, fit, cores_}));
  }

  [[nodiscard]] std::filesystem::path log_of(const FarmTask& task) const {
    return plan_.folder() / "log" / task.name();
  }

  void start(const FarmTask& task) {
    // Complete its command line
    std::vector<std::string> words = task.command;
    words[0] = std::filesystem::read_symlink("/proc/self/exe").string();
    words.insert(words.end(),
                 {"--threads", std::to_string(std::max(1U, cores_ / at_once(task))), "--quiet"});
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);

    // Start it with its messages in a file
    const std::string log = log_of(task).string();
    const pid_t parent = ::getpid(), child = ::fork();
    if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
    if (child == 0) become(arguments.data(), log.c_str(), parent);
    running_[child] = &task;
    used_bytes_ += task.memory_bytes;
  }

  void await_one() {
    int status = 0;
    pid_t child = 0;
    do child = waitpid(-1, &status, 0);
    while (child < 0 && errno == EINTR);
    if (child < 0) throw std::system_error(errno, std::generic_category(), "waitpid");
    const auto found = running_.find(child);
    if (found == running_.end()) return;
    const FarmTask& task = *found->second;
    running_.erase(found);
    used_bytes_ -= task.memory_bytes;
    const int code = WIFSIGNALED(status) ? kSignalCode + WTERMSIG(status) : WEXITSTATUS(status);
    if (worth_retry(code) && result_.failed.empty() && tries_[&task]++ < kMaxRetries) {
      ++result_.retried;
      waiting_.push_back(&task);  // behind the others: what they take may be free then
      progress_.note(fmt::format("{} failed with code {} and is run again", task.name(), code));
      return;
    }
    progress_.advance(1);
    if (code == 0) {
      ++done_[task.step];
      ++result_.ran;
    } else {
      fail(task, code);
    }
  }

  /// @param code  as a shell has it
  void fail(const FarmTask& task, int code) {
    std::string text = text_of_log(log_of(task));
    if (code > kSignalCode)
      text += fmt::format("{}: it was ended by signal {}\n", task.name(), code - kSignalCode);
    note_failure(plan_, task, text);
    result_.failed.push_back(task.name());
    result_.errors += fmt::format("{} failed:\n{}", task.name(), text);
    if (result_.exit_code == 0)
      result_.exit_code = code > kSignalCode ? static_cast<int>(kSystem) : code;
  }

  const FarmPlan& plan_;
  std::uint64_t memory_bytes_;
  unsigned cores_;
  Progress& progress_;
  std::vector<const FarmTask*> waiting_;
  std::map<pid_t, const FarmTask*> running_;
  std::map<TaskStep, std::uint64_t> counts_, done_;  ///< tasks of a step, and how many are done
  std::map<const FarmTask*, unsigned> tries_;        ///< that failed
  std::uint64_t used_bytes_ = 0;
  FarmRun result_;
};

}  // namespace

FarmRun run_plan(const FarmPlan& plan, const RunOptions& run, Progress& progress) {
  return Runner(plan, run, progress).run();
}

}  // namespace ptc
