#include "tools/slurm_jobs.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <memory>
#include <set>
#include <sstream>
#include <system_error>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/file/state_file.h"
#include "engine/io/file/text_file.h"
#include "engine/pipeline/farm/tasks.h"
#include "tools/farm_status.h"
#include "tools/slurm_arrays.h"

namespace ptc {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::milliseconds kLookAgain(500);
constexpr std::chrono::seconds kLeaveQueue(30);
constexpr char kFormat[] = "ptcfarm jobs 1";

/// What a program said and how it ended.
struct Said {
  std::string text;
  int code = 0;  ///< as a shell has it
};

/// Runs a program to its end.
Said run_program(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += quoted(word) + " ";
  std::FILE* const pipe = ::popen((line + "2>&1 </dev/null").c_str(), "re");
  if (pipe == nullptr) throw std::system_error(errno, std::generic_category(), words[0]);
  Said said;
  std::array<char, 4096> buffer;
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    said.text.append(buffer.data(), count);
  const int status = ::pclose(pipe);
  said.code = WIFEXITED(status) ? WEXITSTATUS(status) : 255;
  return said;
}

[[noreturn]] void fail(const std::string& program, const Said& said) {
  std::string text = said.text;
  while (text.ends_with('\n')) text.pop_back();
  throw std::system_error(std::make_error_code(std::errc::io_error), program + ": " + text);
}

/// The array of jobs that was submitted for some tasks of a step.
struct Job {
  std::string id;
  std::string name;  ///< of the array
};

std::filesystem::path jobs_file(const FarmPlan& plan) {
  return slurm_folder(plan) / "jobs.json";
}

void write_jobs(const FarmPlan& plan, const std::vector<Job>& jobs) {
  Json list = Json::array();
  for (const Job& job : jobs) list.push_back({{"id", job.id}, {"name", job.name}});
  write_text(jobs_file(plan), Json{{"format", kFormat}, {"jobs", list}}.dump(1) + "\n");
}

std::vector<Job> read_jobs(const FarmPlan& plan) {
  const std::filesystem::path path = jobs_file(plan);
  std::vector<Job> jobs;
  if (!std::filesystem::exists(path)) return jobs;
  try {
    const Json json = Json::parse(read_text(path));
    if (json.at("format") != kFormat) throw DataError(path.string() + ": it lists no jobs");
    for (const Json& job : json.at("jobs")) {
      jobs.push_back({job.at("id"), job.at("name")});
      const auto digit = [](char c) { return c >= '0' && c <= '9'; };
      if (jobs.back().id.empty() || !std::ranges::all_of(jobs.back().id, digit))
        throw DataError(path.string() + ": the number of a job is none");
    }
  } catch (const nlohmann::json::exception& error) {
    throw DataError(path.string() + ": " + error.what());
  }
  return jobs;
}

/// A line of squeue.
struct Queued {
  std::string id, index, state, reason, machines;
};

/// Returns the jobs of a list that are in the queue.
/// @throws std::system_error when Slurm does not answer
std::vector<Queued> queued(const std::vector<Job>& jobs) {
  std::string ids;
  for (const Job& job : jobs) ids += (ids.empty() ? "" : ",") + job.id;
  if (ids.empty()) return {};
  const Said said =
      run_program({"squeue", "--noheader", "--array", "--jobs=" + ids, "--format=%F|%K|%T|%r|%N"});
  // It forgets jobs some minutes after their end, and refuses a list of one that it has forgotten
  if (said.code != 0 && said.text.find("Invalid job id") != std::string::npos) return {};
  if (said.code != 0) fail("squeue", said);
  std::vector<Queued> list;
  std::istringstream lines(said.text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    Queued one;
    for (std::string* word : {&one.id, &one.index, &one.state, &one.reason, &one.machines})
      std::getline(words, *word, '|');
    const bool ours = std::ranges::find(jobs, one.id, &Job::id) != jobs.end();
    if (ours && !one.state.empty()) list.push_back(std::move(one));
  }
  return list;
}

std::set<std::string> ids_of(const std::vector<Queued>& list) {
  std::set<std::string> ids;
  for (const Queued& one : list) ids.insert(one.id);
  return ids;
}

/// Submits an array. @return  its number
std::string submit(const FarmPlan& plan, const SlurmArray& array,
                   const std::vector<std::string>& after, unsigned cores) {
  // Write its script
  std::string text = "#!/bin/sh\n";
  for (const std::string& option : slurm_options(plan, array, cores))
    text += "#SBATCH " + option + "\n";
  const std::filesystem::path script = slurm_folder(plan) / (array.name + ".sh");
  write_text(script, text + slurm_script(array));

  // Submit it
  std::vector<std::string> words{"sbatch", "--parsable"};
  std::string jobs;
  for (const std::string& id : after) jobs += ":" + id;
  if (!after.empty()) words.push_back("--dependency=afterok" + jobs);
  words.push_back(script.string());
  const Said said = run_program(words);
  const std::string id = said.text.substr(0, said.text.find_first_of(";\n"));
  if (said.code != 0 || id.empty() || id.find_first_not_of("0123456789") != std::string::npos)
    fail("sbatch", said);
  return id;
}

}  // namespace

std::filesystem::path slurm_folder(const FarmPlan& plan) {
  return std::filesystem::path(plan.file).replace_extension(".slurm");
}

std::vector<std::string> submit_to_slurm(const FarmPlan& plan, unsigned cores) {
  // See that no jobs of the plan are under way
  std::filesystem::create_directories(slurm_folder(plan));
  std::filesystem::create_directories(plan.folder() / "log");
  const FileLock lock(slurm_folder(plan) / "lock");
  if (const auto waiting = ids_of(queued(read_jobs(plan))); !waiting.empty()) {
    throw DataError(fmt::format("{}: jobs {} of it wait or run: cancel them first",
                                plan.file.string(), fmt::join(waiting, ", ")));
  }

  // Submit a step after the other
  std::vector<Job> jobs;
  std::vector<std::string> all, after;
  TaskMarks marks(plan);
  const auto undone = [&](const FarmTask& task) { return !marks.is_done(task); };
  try {
    for (const TaskStep& step : steps_of(plan)) {
      std::vector<std::string> ids;
      for (const SlurmArray& array : slurm_arrays(plan, step, undone)) {
        ids.push_back(submit(plan, array, after, cores));
        jobs.push_back({ids.back(), array.name});
        write_jobs(plan, jobs);
      }
      all.insert(all.end(), ids.begin(), ids.end());
      if (!ids.empty()) after = std::move(ids);
    }
  } catch (...) {
    std::vector<std::string> words{"scancel"};
    for (const Job& job : jobs) words.push_back(job.id);
    if (!jobs.empty()) run_program(words);
    throw;
  }
  for (const FarmTask& task : plan.tasks) {
    if (undone(task)) forget_failure(plan, task);
  }
  note_begin(plan);
  if (all.empty()) remove_spent(plan);
  return all;
}

std::optional<SlurmQueue> slurm_queue(const FarmPlan& plan) {
  const std::vector<Job> jobs = read_jobs(plan);
  if (jobs.empty()) return std::nullopt;
  SlurmQueue queue;
  for (const FarmTask& task : plan.tasks) {
    const std::string log = slurm_log(plan, task).filename().string();
    const std::size_t dot = log.rfind('.');
    const auto job = std::ranges::find(jobs, log.substr(0, dot), &Job::name);
    if (job != jobs.end()) queue.tasks[task.name()].job = job->id + "_" + log.substr(dot + 1);
  }
  try {
    std::map<std::string, const Queued*> by_job;
    const std::vector<Queued> list = queued(jobs);
    for (const Queued& one : list) by_job[one.id + "_" + one.index] = &one;
    for (auto& [name, task] : queue.tasks) {
      const auto found = by_job.find(task.job);
      if (found == by_job.end()) continue;
      task.state = found->second->state;
      task.where =
          found->second->machines.empty() ? found->second->reason : found->second->machines;
    }
  } catch (const std::system_error& error) {
    queue.trouble = error.what();
  }
  return queue;
}

std::string slurm_end(const std::string& job) {
  // A cluster that keeps accounts knows all jobs, another one those that ended lately
  const Said accounts = run_program(
      {"sacct", "--noheader", "--parsable2", "--allocations", "--jobs=" + job, "--format=State"});
  const auto is_state = [](const std::string& word) {
    return !word.empty() &&
           std::ranges::all_of(word, [](char c) { return (c >= 'A' && c <= 'Z') || c == '_'; });
  };
  const std::string state = accounts.text.substr(0, accounts.text.find_first_of(" \n"));
  if (accounts.code == 0 && is_state(state)) return state;
  const Said shown = run_program({"scontrol", "--oneliner", "show", "job", job});
  const std::string key = "JobState=";
  const std::size_t at = shown.text.find(key);
  if (shown.code != 0 || at == std::string::npos) return {};
  const std::string rest = shown.text.substr(at + key.size());
  return rest.substr(0, rest.find_first_of(" \n"));
}

std::vector<std::string> cancel_in_slurm(const FarmPlan& plan) {
  const std::vector<Job> jobs = read_jobs(plan);
  if (jobs.empty()) throw DataError(plan.file.string() + ": no jobs of it were submitted");
  const FileLock lock(slurm_folder(plan) / "lock");
  const std::set<std::string> ids = ids_of(queued(jobs));
  if (ids.empty()) return {};

  // Cancel them until they have left: a task that ends at this moment may queue its job again
  const auto end = std::chrono::steady_clock::now() + kLeaveQueue;
  for (std::set<std::string> left = ids; !left.empty(); left = ids_of(queued(jobs))) {
    if (std::chrono::steady_clock::now() > end) {
      throw std::system_error(std::make_error_code(std::errc::timed_out),
                              fmt::format("jobs {} do not end", fmt::join(left, ", ")));
    }
    std::vector<std::string> words{"scancel"};
    words.insert(words.end(), left.begin(), left.end());
    if (const Said said = run_program(words); said.code != 0) fail("scancel", said);
    std::this_thread::sleep_for(kLookAgain);
  }
  return {ids.begin(), ids.end()};
}

}  // namespace ptc
