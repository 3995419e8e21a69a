// ptcrender: renders a picture of a scene, lit directly by rays and indirectly by its surfels.
#include "tools/render_arguments.h"

namespace {

constexpr char kPurpose[] =
    "Renders a picture of a container or a cloud, with direct and indirect light.\n"
    "Rays from the camera meet the meshes, or the surfels of the container when no mesh is given. "
    "Direct light comes by shadow rays from the lights and the sky; indirect light is gathered "
    "from the surfels. Of clouds and meshes a container is built first, in a temporary file.\n"
    "\n"
    "An .exr holds the picture in linear light, in W/m^2/sr, with alpha and depth (Z), and the "
    "layers direct, indirect, occlusion, bent_normal, albedo, position (P) and normal (N). Of "
    "meshes it also holds object_id and material_id, whose names are in its header; with "
    "--estimate occlusion_error and irradiance_error, with --glossy reflection and "
    "reflection_occlusion. A .png holds the picture or one of its layers, for display.";
constexpr char kExamples[] =
    "  # Render a mesh with the light of its container\n"
    "  ptcrender dragon.ptcx --mesh dragon.ply --backdrop -o dragon.png\n"
    "  # Render a scan, or the tiles of one\n"
    "  ptcrender scan.laz -o scan.png\n"
    "  ptcrender tiles/ --size 1920x1080 -o scan.png\n"
    "  # Choose the camera and write all layers\n"
    "  ptcrender room.ptcx --camera 0,1.6,4,0,1.2,0 --fov 50 --size 1920x1080 -o room.exr\n"
    "  # Write the picture, and its occlusion as a picture of its own\n"
    "  ptcrender room.ptcx -o room.png --layer occlusion=occlusion.png\n"
    "  # Write the numbers of objects and materials, and a picture of the objects\n"
    "  ptcrender room.obj chair.glb -o room.exr --layer object_id=objects.png\n"
    "  # Render what the surfaces would reflect if they were rough mirrors, too\n"
    "  ptcrender room.ptcx --glossy 0.3 -o room.exr --layer reflection=reflection.png\n"
    "  # Go once around what is seen, in 48 pictures\n"
    "  ptcrender dragon.ptcx --mesh dragon.ply --turntable 48 -o turn.##.png\n"
    "  # Render frames of the second camera of a file, as its animation has it\n"
    "  ptcrender shot.glb --camera-name closeup --frames 1-100 -o shot.####.exr\n"
    "  # Meet an error of 3 %, and measure the error at 1000 receivers\n"
    "  ptcrender dragon.ptcx --error 3% --check 1000 -o dragon.exr\n";

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcrender", kPurpose, kExamples);
  ptc::RenderArguments arguments;
  arguments.declare(command);
  return command.run(argc, argv, [&](ptc::Progress& progress) {
    return arguments.render(command, command.run_options(), progress);
  });
}
