// Methods behind one interface. The gather shades the whole set, since neighbours share its work;
// the others shade each receiver by itself, so it is enough to time the checked ones:
//
//   set      . . . . . . . . . . . . . . . .   GatherMethod times all of them
//   checked    *     *   *         *     *     the other methods time these
//   window           - - - - -                 shaded once more, not timed, by result()
#include "tools/bench/references/methods.h"

#include <algorithm>
#include <random>

#include "engine/base/memory.h"
#include "engine/scene/light/lights.h"
#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/reference/plain_gather.h"
#include "engine/trace/ray_shader.h"

namespace ptc::bench {
namespace {

/// The hierarchical gather, as ptcshade runs it.
class GatherMethod : public Method {
 public:
  GatherMethod(const ContainerReader& container, const Sky& sky, const ReceiverSet& set,
               const Checked& checked, const GatherOptions& options, PageCache& cache,
               const Executor& executor)
      : set_(set),
        checked_(checked),
        shader_(container, {.gather = options, .sky = sky_function(sky), .cache = &cache},
                executor),
        results_(set.receivers.size()) {}

  Cost run() override {
    Progress silent;
    const Cost cost = timed([&] { shader_.shade(set_.receivers, results_, silent); });
    static_cast<void>(shader_.cache_statistics());  // returns its readers to the shared cache
    return cost;
  }
  [[nodiscard]] std::size_t receivers() const override { return results_.size(); }
  [[nodiscard]] Shadings result() override {
    const auto pick = [&](const std::vector<std::size_t>& indices) {
      std::vector<Shading> picked;
      for (const std::size_t i : indices) picked.push_back(results_[i]);
      return picked;
    };
    return {pick(checked_.receivers), pick(checked_.window)};
  }
  [[nodiscard]] GatherCounts counts() const override { return shader_.counts(); }

 private:
  const ReceiverSet& set_;
  const Checked& checked_;
  Shader shader_;
  std::vector<Shading> results_;
};

/// A method that shades each receiver by itself: only the checked receivers are timed.
class OneByOne : public Method {
 public:
  OneByOne(const ReceiverSet& set, const Checked& checked, const Executor& executor)
      : set_(set), checked_(checked), executor_(executor) {}

  Cost run() override {
    return timed([&] { last_ = shade_all(checked_.receivers); });
  }
  [[nodiscard]] std::size_t receivers() const override { return checked_.receivers.size(); }
  [[nodiscard]] Shadings result() override { return {last_, shade_all(checked_.window)}; }

 protected:
  virtual Shading shade(const Receiver& receiver, std::size_t index, unsigned thread) = 0;

 private:
  std::vector<Shading> shade_all(const std::vector<std::size_t>& indices) {
    constexpr std::size_t kGrain = 16;
    std::vector<Shading> results(indices.size());
    executor_.for_each((indices.size() + kGrain - 1) / kGrain,
                       [&](std::size_t block, unsigned thread) {
                         for (std::size_t i = block * kGrain;
                              i < std::min(indices.size(), (block + 1) * kGrain); ++i) {
                           results[i] = shade(set_.receivers[indices[i]], indices[i], thread);
                         }
                       });
    return results;
  }

  const ReceiverSet& set_;
  const Checked& checked_;
  const Executor& executor_;
  std::vector<Shading> last_;
};

/// The plain gather, with one object for each thread.
class PlainMethod : public OneByOne {
 public:
  PlainMethod(const BenchScene& scene, const ReceiverSet& set, const Checked& checked,
              const GatherOptions& options, PageCache& cache, const Executor& executor)
      : OneByOne(set, checked, executor),
        view_(scene.container()),
        grid_(options.resolution, sky_function(scene.lights().sky)),
        options_(options),
        cache_(cache),
        gathers_(executor.threads()) {}

  Cost run() override {
    const Cost cost = OneByOne::run();
    for (auto& gather : gathers_) gather.reset();  // the cache has readers for one method at a time
    return cost;
  }
  [[nodiscard]] Shadings result() override {
    Shadings shadings = OneByOne::result();
    for (auto& gather : gathers_) gather.reset();
    return shadings;
  }

 protected:
  Shading shade(const Receiver& receiver, std::size_t, unsigned thread) override {
    if (!gathers_[thread])
      gathers_[thread] = std::make_unique<PlainGather>(view_, cache_, options_);
    return gathers_[thread]->shade(receiver, grid_);
  }

 private:
  SceneView view_;
  DirectionGrid grid_;
  GatherOptions options_;
  PageCache& cache_;
  std::vector<std::unique_ptr<PlainGather>> gathers_;
};

/// Rays through the octree, as --check traces them.
class OwnRayMethod : public Method {
 public:
  OwnRayMethod(const ContainerReader& container, const Sky& sky, const ReceiverSet& set,
               const Checked& checked, bool bleeding, unsigned rays, const Executor& executor)
      : set_(set),
        checked_(checked),
        rays_(rays),
        shader_(container,
                {.sky = sky_function(sky),
                 .bleeding = bleeding,
                 .memory_bytes =
                     PageCache::bytes_for(container, executor.threads(), container.page_count()) +
                     executor.threads() * DiscTracer::kBytes},
                executor) {}

  Cost run() override {
    return timed([&] { last_ = shade_all(checked_.receivers); });
  }
  [[nodiscard]] std::size_t receivers() const override { return checked_.receivers.size(); }
  [[nodiscard]] Shadings result() override { return {last_, shade_all(checked_.window)}; }

 private:
  std::vector<Shading> shade_all(const std::vector<std::size_t>& indices) {
    std::vector<Receiver> receivers(indices.size());
    std::ranges::transform(indices, receivers.begin(),
                           [&](std::size_t i) { return set_.receivers[i]; });
    std::vector<Shading> results(indices.size());
    Progress silent;
    shader_.trace(receivers, rays_, 0, results, silent);
    return results;
  }

  const ReceiverSet& set_;
  const Checked& checked_;
  unsigned rays_;
  RayShader shader_;
  std::vector<Shading> last_;
};

/// Rays; the index of a receiver is the seed of its rays.
class RayMethod : public OneByOne {
 public:
  RayMethod(const RayBaseline& baseline, const ReceiverSet& set, const Checked& checked,
            const RaySetting& setting, const Executor& executor)
      : OneByOne(set, checked, executor), baseline_(baseline), setting_(setting) {}

 protected:
  Shading shade(const Receiver& receiver, std::size_t index, unsigned) override {
    return baseline_.trace(receiver, setting_.job, setting_.packets, setting_.rays, index);
  }

 private:
  const RayBaseline& baseline_;
  RaySetting setting_;
};

}  // namespace

Checked choose_checked(const BenchScene& scene, const ReceiverSet& set, unsigned wanted) {
  // Draw receivers at random
  Checked checked;
  std::vector<std::size_t> all(set.receivers.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  std::mt19937_64 bits;  // its default seed gives the same choice each time
  std::ranges::sample(all, std::back_inserter(checked.receivers), wanted, bits);
  // Put neighbours next to each other
  const Frame& frame = scene.container().header().frame;
  std::ranges::sort(checked.receivers, {}, [&](std::size_t i) {
    return receiver_key(frame, set.receivers[i].position, 0);
  });
  // Take the window's pixels that see something
  for (const Pixel& pixel : set.window) {
    if (pixel.receiver != ReceiverSet::kNone) checked.window.push_back(pixel.receiver);
  }
  return checked;
}

std::unique_ptr<Method> make_gather(const ContainerReader& container, const Sky& sky,
                                    const ReceiverSet& set, const Checked& checked,
                                    const GatherOptions& options, PageCache& cache,
                                    const Executor& executor) {
  return std::make_unique<GatherMethod>(container, sky, set, checked, options, cache, executor);
}

std::unique_ptr<Method> make_plain(const BenchScene& scene, const ReceiverSet& set,
                                   const Checked& checked, const GatherOptions& options,
                                   PageCache& cache, const Executor& executor) {
  return std::make_unique<PlainMethod>(scene, set, checked, options, cache, executor);
}

std::unique_ptr<Method> make_own_rays(const ContainerReader& container, const Sky& sky,
                                      const ReceiverSet& set, const Checked& checked, bool bleeding,
                                      unsigned rays, const Executor& executor) {
  return std::make_unique<OwnRayMethod>(container, sky, set, checked, bleeding, rays, executor);
}

std::unique_ptr<Method> make_rays(const RayBaseline& baseline, const ReceiverSet& set,
                                  const Checked& checked, const RaySetting& setting,
                                  const Executor& executor) {
  return std::make_unique<RayMethod>(baseline, set, checked, setting, executor);
}

}  // namespace ptc::bench
