#include "tools/values.h"

#include <charconv>

namespace ptc {
namespace {

std::string range_text(const std::string& least, const std::string& most) {
  return "expects a number from " + least + " to " + most;
}

}  // namespace

CLI::Validator in_range(double least, double most) {
  const auto text = [](double x) {
    std::string digits(32, '\0');
    digits.resize(static_cast<std::size_t>(
        std::to_chars(digits.data(), digits.data() + digits.size(), x).ptr - digits.data()));
    return digits;
  };
  const std::string expects = range_text(text(least), text(most));
  return CLI::Validator(
      [=](std::string& input) {
        const auto value = parse_number<double>(input);
        return value && *value >= least && *value <= most ? std::string()
                                                          : expects + ", not '" + input + "'";
      },
      "");
}

CLI::Validator whole_in_range(std::uint64_t least, std::uint64_t most) {
  const std::string expects = range_text(std::to_string(least), std::to_string(most));
  return CLI::Validator(
      [=](std::string& input) {
        const auto value = parse_number<std::uint64_t>(input);
        return value && *value >= least && *value <= most ? std::string()
                                                          : expects + ", not '" + input + "'";
      },
      "");
}

CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& count,
                       const std::string& description) {
  return app
      .add_option_function<std::string>(
          name, [&count, name](const std::string& text) { count = parse_count(name, text); },
          description)
      ->type_name("COUNT");
}

CLI::Option* add_size(CLI::App& app, const std::string& name, std::uint64_t& bytes,
                      const std::string& description) {
  const std::uint64_t mebibytes = bytes >> 20;
  const bool whole = mebibytes % 1024 == 0;
  return app
      .add_option_function<std::string>(
          name, [&bytes, name](const std::string& text) { bytes = parse_size(name, text); },
          description)
      ->type_name("SIZE")
      ->default_str(whole ? std::to_string(mebibytes / 1024) + "G"
                          : std::to_string(mebibytes) + "M");
}

}  // namespace ptc
