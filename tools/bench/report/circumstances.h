// The machine, the system, the commit and the time of a measurement: the head of a file of results.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace ptc::bench {

/// Where and when a measurement ran.
struct Circumstances {
  std::string processor;           ///< name of the model
  unsigned cores = 0;              ///< cores that this process may use
  std::uint64_t memory_bytes = 0;  ///< main memory of the machine
  std::string system;              ///< kernel, its release and the architecture
  std::string instructions;        ///< best instruction set that the kernels can use here
  double load = 0;                 ///< mean number of running threads, minute before
  std::string commit;              ///< commit of the source tree, or "unknown"
  bool changed = false;            ///< the tree had changes that were not committed
  std::string date;                ///< UTC, "2025-01-31 12:00"
  std::string command;             ///< public_command()
};

/// Collects the machine, the present time and the commit that the program was built from.
/// @param command  arguments of main(), the program's name first
/// @param commit   stands for the commit where the build did not know it
[[nodiscard]] Circumstances circumstances_of(std::span<char* const> command,
                                             const std::string& commit);

/// A command line that can be published: each path is cut to its last name, so that no directory of
/// the machine is shown, and words with blanks are in quotes. "--results=/home/a/b" becomes
/// "--results=b".
[[nodiscard]] std::string public_command(std::span<char* const> command);

}  // namespace ptc::bench
