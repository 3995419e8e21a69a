// Runs other programs, some of them in Python, for libraries that are compared with PTCX.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace ptc::bench {

/// Runs a program and returns what it wrote as JSON into the file that its last argument names.
/// @param command  the program and its arguments but for the last one
/// @param work     directory for temporary files
/// @param what     the library that it runs, for the message
/// @throws DataError when the program fails; std::system_error
[[nodiscard]] nlohmann::json run_rival(const std::vector<std::string>& command,
                                       const std::filesystem::path& work, const std::string& what);

/// Runs a program in Python, in an interpreter of its own, and returns what it wrote as JSON into
/// the file that its last argument names.
/// @param work       directory for temporary files
/// @param program    text of the program
/// @param arguments  of the program, but for the last one
/// @param what       the library that it runs, for the message
/// @throws DataError when the program fails; std::system_error
[[nodiscard]] nlohmann::json run_python(const std::filesystem::path& interpreter,
                                        const std::filesystem::path& work,
                                        const std::string& program,
                                        const std::vector<std::string>& arguments,
                                        const std::string& what);

}  // namespace ptc::bench
