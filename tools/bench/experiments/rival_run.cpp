#include "tools/bench/experiments/rival_run.h"

#include <cstdlib>
#include <fstream>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/text_file.h"
#include "tools/bench/report/report.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {

nlohmann::json run_rival(const std::vector<std::string>& command, const std::filesystem::path& work,
                         const std::string& what) {
  const WorkFile facts(work, "-facts");
  std::string line;
  for (const std::string& word : command) line += fmt::format("'{}' ", word);
  line += fmt::format("'{}'", facts.path().string());
  if (std::system(line.c_str()) != 0)  // NOLINT(cert-env33-c): the user names the program
    throw DataError(command.at(0) + " cannot run " + what);
  std::ifstream in(facts.path());
  return nlohmann::json::parse(in);
}

nlohmann::json run_python(const std::filesystem::path& interpreter,
                          const std::filesystem::path& work, const std::string& program,
                          const std::vector<std::string>& arguments, const std::string& what) {
  const WorkFile script(work, "-program.py");
  write_text(script.path(), program);
  std::vector<std::string> command{interpreter.string(), script.path().string()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return run_rival(command, work, what);
}

}  // namespace ptc::bench
