// Internal to the point writers: one function for each format, and what they share.
//
//   create_points() --> create_las(), create_ply() ... --> a CheckedWriter
//                                                            write(): sizes are checked
//                                                            finish(): the count is checked
//   losses() --------> las_losses(), ply_losses() ...
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/io/cloud/point_writer.h"

namespace ptc {

/// A PointWriter that has checked its input before the format sees it.
class CheckedWriter : public PointWriter {
 public:
  /// @param row_bytes  bytes of the attributes of a point
  CheckedWriter(std::uint64_t count, std::size_t row_bytes)
      : announced_(count), row_bytes_(row_bytes) {}
  void write(std::span<const Surfel> surfels, std::span<const std::byte> rows) final;
  void finish() final;

 protected:
  /// Returns the number of points of the finished file.
  [[nodiscard]] std::uint64_t announced() const noexcept { return announced_; }

 private:
  /// Writes one point. It is called at most announced() times.
  virtual void put(const Surfel& surfel, const std::byte* row) = 0;
  /// Completes the file, which holds announced() points, and publishes it.
  virtual void end() = 0;

  std::uint64_t announced_;
  std::uint64_t written_ = 0;
  std::size_t row_bytes_;
};

/// Each begins a file of its format as create_points() describes.
[[nodiscard]] std::unique_ptr<PointWriter> create_bgeo(const std::filesystem::path& target,
                                                       const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_las(const std::filesystem::path& target,
                                                      const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_pcd(const std::filesystem::path& target,
                                                      const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_ply(const std::filesystem::path& target,
                                                      const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_ptc(const std::filesystem::path& target,
                                                      const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_usda(const std::filesystem::path& target,
                                                       const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_usdc(const std::filesystem::path& target,
                                                       const PointWriteInfo& info);
[[nodiscard]] std::unique_ptr<PointWriter> create_xyz(const std::filesystem::path& target,
                                                      const PointWriteInfo& info);

/// Each returns what losses() says of its format, except what holds for all formats alike.
[[nodiscard]] std::vector<std::string> bgeo_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> las_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> pcd_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> ply_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> ptc_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> usd_losses(const PointWriteInfo& info);
[[nodiscard]] std::vector<std::string> xyz_losses(const PointWriteInfo& info);

/// Says whether a channel has the colour Cd as a BGEO had it, which becomes Cd again.
[[nodiscard]] bool is_linear_colour(const Channel& channel) noexcept;
/// Returns what scaling_notes() says of LAS.
[[nodiscard]] std::vector<std::string> las_scaling_notes(const PointWriteInfo& info);
/// Returns what unknown_losses() says of LAS.
[[nodiscard]] std::vector<std::string> las_unknown_losses(const PointWriteInfo& info);
/// Says that points whose stored colour is not known get that of their albedo.
inline constexpr const char* kAlbedoAsColour =
    "Points without a colour of their own get that of their albedo.";

/// Says that positions are rounded to float by up to `error`; nothing when that is 0.
void add_float_positions(std::vector<std::string>& losses, double error);
/// Says which channels are rounded where a file has floating-point numbers of `digits` bits.
void add_rounded_channels(std::vector<std::string>& losses, const PointWriteInfo& info, int digits);
/// Says which channels a format cannot scale on reading.
void add_unscaled_channels(std::vector<std::string>& losses, const PointWriteInfo& info);
/// Says that the coordinate reference system is not kept, if there is one.
void add_lost_crs(std::vector<std::string>& losses, const PointWriteInfo& info);

}  // namespace ptc
