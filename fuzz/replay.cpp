// Runs files through a fuzz target, for builds without libFuzzer:
//
//   replay_NAME DIR...        runs every file below the directories
//   replay_NAME --odd SOURCE  runs every odd file of the shared data behind each of 16 first bytes,
//                             so that every reader gets it. The data is where PTC_SHARED says, or
//                             in the directory next to SOURCE; without it the exit code is 77
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

void run(const std::vector<char>& bytes) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

// Calls body(bytes) for every regular file below a directory and returns the number of files.
template <class Body>
std::size_t for_each_file(const std::filesystem::path& directory, const Body& body) {
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    body(std::vector<char>((std::istreambuf_iterator<char>(in)), {}));
    ++files;
  }
  std::printf("%zu files\n", files);
  return files;
}

// Runs the odd files and returns the exit code.
int run_odd(const std::filesystem::path& source) {
  const char* const given = std::getenv("PTC_SHARED");
  const auto shared = given != nullptr ? std::filesystem::path(given) : source / "../shared";
  if (!std::filesystem::is_directory(shared / "data/odd")) {
    std::puts("skipped: the folder of odd files is not on this machine");
    return 77;
  }
  const std::size_t files = for_each_file(shared / "data/odd", [](std::vector<char> bytes) {
    bytes.insert(bytes.begin(), '\0');
    for (char picked = 0; picked < 16; ++picked) {
      bytes[0] = picked;
      run(bytes);
    }
  });
  return files == 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && argv[1] == std::string_view("--odd")) return run_odd(argv[2]);
  std::size_t files = 0;
  for (int i = 1; i < argc; ++i) files += for_each_file(argv[i], run);
  return files == 0 ? 1 : 0;
}
