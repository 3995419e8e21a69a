#include "tools/bench/experiments/python_run.h"

#include <cstdlib>
#include <fstream>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "tools/bench/experiments/work_file.h"
#include "tools/bench/report/report.h"

namespace ptc::bench {

nlohmann::json run_python(const std::filesystem::path& interpreter,
                          const std::filesystem::path& work, const std::string& program,
                          const std::vector<std::string>& arguments, const std::string& what) {
  const WorkFile script(work, "-program.py"), facts(work, "-facts");
  write_text(script.path(), program);
  std::string command = fmt::format("'{}' '{}'", interpreter.string(), script.path().string());
  for (const std::string& argument : arguments) command += fmt::format(" '{}'", argument);
  command += fmt::format(" '{}'", facts.path().string());
  if (std::system(command.c_str()) != 0)  // NOLINT(cert-env33-c): the user names the interpreter
    throw DataError(interpreter.string() + " cannot run " + what);
  std::ifstream in(facts.path());
  return nlohmann::json::parse(in);
}

}  // namespace ptc::bench
