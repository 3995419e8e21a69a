// Reads particles of Maya (.pdb, "particle data base"), in the layout of programs with pointers of
// 32 bits. All numbers are little-endian.
//
//   header                     a channel, one behind another
//   0   4   u32 670            0   4   u32 128611
//   4   4   u16 swap           4   38  structures of the writer, which are not used
//   8   4   f32 version, 1     42      name, ended by a byte 0
//   12  4   f32 time               +0  4   u32 type: 1 vector, 2 real, 3 integer
//   16  4   u32 particles          +4  4   u32 bytes of a value: 12 for a vector, 4 for others
//   20  4   u32 channels           +8  4   u32 values in a block: the number of particles
//   24  36  not used               +12 4   u32 blocks, 1
//                                  +16 4   not used
//                                  +20     values
//
// A real of 8 bytes is left out: the only known file that has one has neither doubles nor pairs
// there.
#include <array>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/particle_names.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/file/file.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::uint64_t kHeaderBytes = 60;
constexpr std::uint32_t kPdbMagic = 670;
constexpr std::uint32_t kChannelMagic = 128611;
constexpr std::size_t kNameOffset = 42;
constexpr std::size_t kMaxName = 256;
constexpr std::uint32_t kMaxChannels = 1024;

// What stands behind the name of a channel.
struct ChannelHead {
  std::string name;
  std::uint32_t type = 0;
  std::uint32_t value_bytes = 0;
};

class PdbSource : public ColumnSource {
 public:
  explicit PdbSource(const std::filesystem::path& path) : file_(path) {
    // Read the header.
    std::array<std::byte, kHeaderBytes> begin{};
    read(0, begin, "the header ends too early");
    if (load<std::uint32_t>(begin.data(), 0) != kPdbMagic) fail(0, "not a PDB file of Maya");
    count_ = load<std::uint32_t>(begin.data(), 16);
    const auto channels = load<std::uint32_t>(begin.data(), 20);
    if (channels > kMaxChannels) fail(20, "the PDB has more than 1024 channels");

    // Read the channels, and pass over their values.
    std::uint64_t at = kHeaderBytes;
    for (std::uint32_t i = 0; i < channels; ++i) at = read_channel(at);
    if (at != file_.size()) fail(at, "the file has more data than its header says");
    set_layout(PointLayout(
        path, fields_, {.owner = "the PDB particles", .float_colours = FloatColours::unbounded}));
    set_columns(columns_, record_bytes_, count_);
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.count = count_;
    info.notes = notes_;
    return info;
  }

 private:
  [[noreturn]] void fail(std::uint64_t offset, const std::string& rule) const {
    refuse_file(file_.path(), "offset " + std::to_string(offset) + ": " + rule);
  }

  void read(std::uint64_t offset, std::span<std::byte> out, const char* rule) const {
    if (offset > file_.size() || out.size() > file_.size() - offset) fail(offset, rule);
    file_.read_at(offset, out);
  }

  // Reads the head of the channel at `at`. Returns the offset of its values.
  std::uint64_t read_head(std::uint64_t at, ChannelHead& head) const {
    constexpr const char* kCut = "a channel ends too early";
    std::array<std::byte, 4> magic{};
    read(at, magic, kCut);
    if (load<std::uint32_t>(magic.data(), 0) != kChannelMagic) {
      fail(at,
           "no channel begins here; files with pointers of 64 bits or big-endian numbers are "
           "not supported");
    }
    std::uint64_t offset = at + kNameOffset;
    for (std::array<std::byte, 1> letter{};; head.name += static_cast<char>(letter[0])) {
      read(offset++, letter, kCut);
      if (letter[0] == std::byte{0}) break;
      if (head.name.size() == kMaxName) fail(at, "the name of a channel has more than 256 bytes");
    }
    std::array<std::byte, 20> shape{};
    read(offset, shape, kCut);
    head.type = load<std::uint32_t>(shape.data(), 0);
    head.value_bytes = load<std::uint32_t>(shape.data(), 4);
    if (load<std::uint32_t>(shape.data(), 8) != count_ ||
        load<std::uint32_t>(shape.data(), 12) != 1) {
      fail(at, "the channel '" + head.name + "' is not one block of all particles");
    }
    return offset + shape.size();
  }

  // Reads the channel at `at`. Returns the offset behind it.
  std::uint64_t read_channel(std::uint64_t at) {
    ChannelHead head;
    const std::uint64_t values = read_head(at, head);
    const std::uint64_t bytes = std::uint64_t{head.value_bytes} * count_;
    if (values > file_.size() || bytes > file_.size() - values)
      fail(at, "the values of the channel '" + head.name + "' end too early");
    const bool vector = head.type == 1 && head.value_bytes == 12;
    const bool number = (head.type == 2 || head.type == 3) && head.value_bytes == 4;
    if (vector || number) {
      Channel channel;
      channel.name = head.name;
      channel.type = head.type == 3 ? ChannelType::i32 : ChannelType::f32;
      channel.components = vector ? 3 : 1;
      if (vector) channel.role = ChannelRole::vector;
      add_attribute(channel, record_bytes_, fields_);
      columns_.push_back({head.value_bytes, record_bytes_});
      places_.push_back(values);
      record_bytes_ += head.value_bytes;
    } else {
      notes_.push_back("The channel '" + head.name + "' of type " + std::to_string(head.type) +
                       " with " + std::to_string(head.value_bytes) +
                       " bytes in each particle is left out.");
    }
    return values + bytes;
  }

  void read_column(std::size_t column, std::uint64_t first, std::span<std::byte> out) override {
    file_.read_at(places_[column] + first * columns_[column].bytes, out);
  }

  void fail_record(const std::string& rule) const override { refuse_file(file_.path(), rule); }

  InputFile file_;
  std::uint32_t count_ = 0;
  std::vector<Column> columns_;
  std::vector<std::uint64_t> places_;  // by column: offset of its values
  std::size_t record_bytes_ = 0;
  std::vector<RecordField> fields_;
  std::vector<std::string> notes_;
};

}  // namespace

PointFile open_pdb(const std::filesystem::path& path) {
  return open_source<PdbSource>(path);
}

}  // namespace ptc
