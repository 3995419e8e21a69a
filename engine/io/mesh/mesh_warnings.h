// What a mesh reader leaves out or replaces, in few lines however large the file is.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace ptc {

/// What happens to a part of a file and what is used in its place, said of one part and of several.
struct WarningKind {
  std::string_view one;
  std::string_view several;  ///< follows their number
};

inline constexpr WarningKind kTextureLeftOut{
    "a texture is left out, the plain colour of its material is used",
    "textures are left out, the plain colours of their materials are used"};
inline constexpr WarningKind kEmissionMapLeftOut{
    "an emission map (map_Ke) is left out, the emission Ke of its material is used",
    "emission maps (map_Ke) are left out, the emissions Ke of their materials are used"};
inline constexpr WarningKind kEmissionAveraged{"an emission texture is replaced by its mean",
                                               "emission textures are replaced by their means"};
inline constexpr WarningKind kColourLeftOut{
    "a colour that is not R G B is left out, the default of its material is used",
    "colours that are not R G B are left out, the defaults of their materials are used"};
inline constexpr WarningKind kLibraryLeftOut{
    "a material library is left out, its materials become plain grey",
    "material libraries are left out, their materials become plain grey"};
inline constexpr WarningKind kMaterialUndefined{"a material is not defined, plain grey is used",
                                                "materials are not defined, plain grey is used"};
inline constexpr WarningKind kSkinLeftOut{
    "a skin is left out, its mesh keeps the pose in which it is stored",
    "skins are left out, their meshes keep the pose in which they are stored"};
inline constexpr WarningKind kCameraLeftOut{
    "a camera is left out, it has no direction or no field of view",
    "cameras are left out, they have no direction or no field of view"};

/// The warnings of one file, one line for each kind.
///
/// Memory: 4 parts of each kind; the others are only counted.
class MeshWarnings {
 public:
  /// @param kind  one of the constants above
  /// @param part  what it happens to, and why where that is known; a part that is among the first
  ///              four of its kind already is not told again
  void add(const WarningKind& kind, std::string_view part);

  /// A sentence for each kind in the order in which they came: what happens, to how many parts, and
  /// the first four of them. Parts of more than 300 bytes are cut, control characters are escaped.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  struct Parts {
    const WarningKind* kind;
    std::size_t count = 0;
    std::vector<std::string> first;
  };
  std::vector<Parts> kinds_;
};

}  // namespace ptc
