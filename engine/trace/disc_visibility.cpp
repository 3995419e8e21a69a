#include "engine/trace/disc_visibility.h"

#include <algorithm>

#include "engine/trace/disc_tracer.h"

namespace ptc {
namespace {

class DiscVisibility final : public Visibility {
 public:
  DiscVisibility(const SceneView& view, PageCache& cache, Sides sides)
      : tracer_(view, cache, sides) {}

  void find(const Receiver& receiver, std::span<const glm::vec3> directions,
            std::span<std::uint8_t> covered) override {
    hits_.assign(directions.size(), RayHit{});
    tracer_.begin(receiver.position, receiver.normal);
    tracer_.meet(directions, RaysFor::any, hits_);
    std::ranges::transform(hits_, covered.begin(),
                           [](const RayHit& hit) { return std::uint8_t{hit.met()}; });
  }

 private:
  DiscTracer tracer_;
  std::vector<RayHit> hits_;
};

}  // namespace

VisibilityMaker disc_visibility(Sides sides) {
  return [sides](const SceneView& view, PageCache& cache) {
    return std::make_unique<DiscVisibility>(view, cache, sides);
  };
}

}  // namespace ptc
