// Warnings about the parts of a mesh file that a reader leaves out or replaces, in few lines
// however large the file is.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace ptc {

/// A kind of warning: the words that say what happens to parts of a file and what is used in their
/// place.
struct WarningKind {
  std::string_view one;      ///< the words for a single part
  std::string_view several;  ///< the words for several parts, which follow their number
};

inline constexpr WarningKind kTextureLeftOut{
    "a texture is left out and the plain colour of its material is used",
    "textures are left out and the plain colours of their materials are used"};
inline constexpr WarningKind kEmissionAveraged{"an emission texture is replaced by its mean",
                                               "emission textures are replaced by their means"};
inline constexpr WarningKind kEmissionDark{
    "a material emits nothing, because its emission texture is multiplied by Ke 0 0 0",
    "materials emit nothing, because their emission textures are multiplied by Ke 0 0 0"};
inline constexpr WarningKind kColourLeftOut{
    "a colour that is not R G B is left out and the default of its material is used",
    "colours that are not R G B are left out and the defaults of their materials are used"};
inline constexpr WarningKind kLibraryLeftOut{
    "a material library is left out and its materials become plain grey",
    "material libraries are left out and their materials become plain grey"};
inline constexpr WarningKind kMaterialUndefined{"a material is not defined and becomes plain grey",
                                                "materials are not defined and become plain grey"};
inline constexpr WarningKind kAlphaLeftOut{
    "the alpha of a list of vertex colours is left out",
    "lists of vertex colours lose their alpha, which is left out"};
inline constexpr WarningKind kColoursLeftOut{
    "colours of vertices are left out, because they are not in the file",
    "lists of colours of vertices are left out, because they are not in the file"};
inline constexpr WarningKind kExtensionLeftOut{"an extension of glTF is left out",
                                               "extensions of glTF are left out"};
inline constexpr WarningKind kSkinLeftOut{
    "a skin is left out and its mesh keeps the pose in which it is stored",
    "skins are left out and their meshes keep the pose in which they are stored"};
inline constexpr WarningKind kMorphLeftOut{
    "an animation of morph targets is left out and its mesh keeps the shape in which it is stored",
    "animations of morph targets are left out and their meshes keep the shapes in which they are "
    "stored"};
inline constexpr WarningKind kWeightsLeftOut{
    "weights of morph targets are left out and their mesh keeps the shape in which it is stored",
    "weights of morph targets are left out and their meshes keep the shapes in which they are "
    "stored"};
inline constexpr WarningKind kPrimitiveLeftOut{"a primitive of points or lines is left out",
                                               "primitives of points or lines are left out"};
inline constexpr WarningKind kStatementLeftOut{"a kind of statement is left out",
                                               "kinds of statements are left out"};
inline constexpr WarningKind kFaceColourLeftOut{
    "the colours of faces are left out, because only those of vertices are read",
    "colours of faces are left out, because only those of vertices are read"};
inline constexpr WarningKind kAnimationLeftOut{"a part of an animation is left out",
                                               "parts of animations are left out"};
inline constexpr WarningKind kObjectsLeftOut{
    "all its objects count as one, because there are too many to tell them apart",
    "lists of objects count as one object each, because they are too long"};
inline constexpr WarningKind kLightLeftOut{
    "a light is left out because it has no place or no direction",
    "lights are left out because they have no place or no direction"};
inline constexpr WarningKind kCameraLeftOut{
    "a camera is left out because it has no direction or no field of view",
    "cameras are left out because they have no direction or no field of view"};

/// Collects the warnings of one file, one line for each kind.
///
/// Memory: the first 4 parts of each kind; further parts are only counted.
class MeshWarnings {
 public:
  /// Adds a part to a kind of warning. Each call counts, so a reader adds a part once, however
  /// often the file uses it.
  /// @param kind  one of the constants above
  /// @param part  name of the part, and the reason if it is known
  void add(const WarningKind& kind, std::string_view part);

  /// Returns a sentence for each kind, in the order of their first parts: what happens, to how many
  /// parts, and the first four of them. Parts of more than 300 bytes are cut; control characters
  /// are escaped.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  struct Parts {
    const WarningKind* kind;
    std::size_t count = 0;           // of all parts
    std::vector<std::string> first;  // the first four
  };
  std::vector<Parts> kinds_;
};

}  // namespace ptc
