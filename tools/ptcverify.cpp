// ptcverify: is every byte of a container what the specification says?
#include <fmt/format.h>

#include <chrono>

#include "engine/build/verify.h"
#include "tools/common.h"
#include "tools/report.h"

namespace {

constexpr char kPurpose[] =
    "Walks every page of a container: checksums, order, references, node sums. Names the offset "
    "and\n"
    "the rule of the first thing that is wrong, and exits with 1.";
constexpr char kExamples[] =
    "  ptcverify scene.ptcx\n"
    "  ptcverify city.ptcx --memory 512M --progress --json\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcverify", kPurpose, kExamples);
  std::filesystem::path file;
  command.add_input("file", file, "The container to check")->required();
  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    const ptc::RunOptions& run = command.run_options();
    const auto start = std::chrono::steady_clock::now();
    const ptc::VerifyReport report = ptc::verify_container(
        file, {.memory_bytes = run.memory_bytes, .threads = run.threads}, progress);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    return {{{"file", file.string()},
             {"valid", true},
             {"pages", report.pages},
             {"points", report.points},
             {"nodes", report.nodes},
             {"node_groups", report.groups},
             {"levels", report.levels},
             {"bytes", report.file_bytes},
             {"seconds", seconds.count()}},
            fmt::format("{}: valid: {} pages, {} points, {} nodes in {} groups, {}, {:.2f} s\n",
                        file.string(), report.pages, report.points, report.nodes, report.groups,
                        ptc::bytes_text(report.file_bytes), seconds.count())};
  });
}
