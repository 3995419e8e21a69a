// The materials of OBJ files. Statements that are not understood are left out and told.
#include "engine/io/mesh/mtl.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <utility>

#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

class MtlReader {
 public:
  MtlReader(const std::filesystem::path& path, TextureLoader& textures,
            std::map<std::string, Material>& materials, MeshWarnings& warnings)
      : stream_(path), textures_(textures), materials_(materials), warnings_(warnings) {}

  void read() {
    std::string_view line;
    while (stream_.next_line(line)) {
      line = line.substr(0, line.find('#'));
      Words words(line);
      const std::string_view keyword = words.next();
      if (keyword == "newmtl") {
        begin(std::string(words.rest()));
      } else if (current_ != nullptr) {
        set(keyword, words);
      }
    }
    end();
  }

 private:
  void begin(const std::string& name) {
    end();
    const auto [at, is_new] = materials_.try_emplace(name);
    current_ = is_new ? &at->second : nullptr;
    if (is_new) current_->name = name;
    emission_given_ = false;
  }

  void end() {
    if (current_ && current_->emission_texture && current_->emission == glm::vec3(0))
      warnings_.add(kEmissionDark, current_->name);
  }

  void set(std::string_view keyword, Words& words) {
    if (keyword == "Kd") {
      read_colour(words, 1, current_->albedo);
    } else if (keyword == "Ke") {
      read_colour(words, std::numeric_limits<float>::max(), current_->emission);
      emission_given_ = true;
    } else if (keyword == "d" || keyword == "Tr") {
      const auto value = parse_number(words.next());
      if (!value || std::isnan(*value)) return;
      const auto share = static_cast<float>(std::clamp(*value, 0.0, 1.0));
      current_->opacity = keyword == "d" ? share : 1 - share;
    } else if (keyword == "map_d") {
      TextureWrap wrap;  // that of the colour holds for both
      const std::string name = file_name(words, wrap);
      if (!name.empty())
        current_->opacity_texture = textures_.load(name, TextureUse::alpha_or_grey);
    } else if (keyword == "map_Kd") {
      const std::string name = file_name(words, current_->wrap);
      if (!name.empty()) current_->texture = textures_.load(name);
    } else if (keyword == "map_Ke") {
      const std::string name = file_name(words, current_->emission_wrap);
      if (!name.empty()) current_->emission_texture = textures_.load(name);
      // A map alone is the emission
      if (current_->emission_texture && !emission_given_) current_->emission = glm::vec3(1);
    } else if (!keyword.empty() && keyword != "illum" && told_.size() < kMostTold &&
               told_.emplace(keyword).second) {
      warnings_.add(kStatementLeftOut, "'" + std::string(keyword) + "' of materials");
    }
  }

  [[nodiscard]] std::string place() const {
    return stream_.path().filename().string() + ": line " + std::to_string(stream_.line());
  }

  // Reads R G B, where one number stands for all three. A first word that is not a number belongs
  // to a spectral curve or an xyz colour, which is left out with a warning.
  void read_colour(Words& words, float most, glm::vec3& colour) {
    std::array<std::optional<double>, 3> values;
    for (auto& value : values) value = parse_number(words.next());
    if (!values[0]) {
      warnings_.add(kColourLeftOut, place());
      return;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const double value = values[i].value_or(*values[0]);
      const double limited = value > 0 ? std::min<double>(value, most) : 0;  // NaN becomes 0
      colour[static_cast<int>(i)] = static_cast<float>(limited);
    }
  }

  // Returns what follows the options, each of which is -NAME and its values. Of these, -clamp is
  // understood.
  static std::string file_name(Words words, TextureWrap& wrap) {
    wrap = {};
    for (;;) {
      Words ahead = words;
      const std::string_view option = ahead.next();
      if (option.size() < 2 || option[0] != '-') return std::string(words.rest());
      int values = option == "-mm" ? 2 : 1;
      if (option == "-o" || option == "-s" || option == "-t") values = 3;
      for (int i = 0; i < values; ++i) {
        Words after = ahead;
        const std::string_view value = after.next();
        // The options -o, -s and -t may have fewer than three numbers.
        if (i > 0 && values == 3 && !parse_number(value)) break;
        ahead = after;
        if (option == "-clamp" && value == "on") wrap = {Wrap::clamp, Wrap::clamp};
      }
      words = ahead;
    }
  }

  ByteStream stream_;
  TextureLoader& textures_;
  std::map<std::string, Material>& materials_;
  MeshWarnings& warnings_;
  static constexpr std::size_t kMostTold = 64;
  std::set<std::string, std::less<>> told_;  // statements that are left out
  Material* current_ = nullptr;
  bool emission_given_ = false;  // Ke of the current material
};

}  // namespace

void read_mtl(const std::filesystem::path& path, TextureLoader& textures,
              std::map<std::string, Material>& materials, MeshWarnings& warnings) {
  MtlReader(path, textures, materials, warnings).read();
}

}  // namespace ptc
