// SPDX-License-Identifier: Apache-2.0
// T18: whether forward and backward pass agree on the contributors of every pixel, and how far the
// transmittance recovered in front of all splats is from 1.
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

// kernels/checks/stress_replay.cl walks the lists of an image as splat_fwd and splat_bwd do.
class Replay {
 public:
  explicit Replay(Queue& queue)
      : queue_(queue),
        program_(queue, "checks/stress_replay.cl"),
        forward_(program_, "replay_fwd"),
        backward_(program_, "replay_bwd") {}

  struct Counts {
    double pixel_splats = 0, contributors = 0, mismatches = 0, other_images = 0, off_front = 0;
  };
  void compare(const PosedScene& s, Counts& counts) {
    DeviceScene device(queue_, s, {false, false});
    device.forward();
    const Images& images = device.engine.images();
    const Splats& splats = device.engine.splats();
    const Tiles& tiles = device.engine.tiles();
    const size_t pixels = s.pixels();
    const int width = s.shot.camera.width, height = s.shot.camera.height;
    Buffer<float> T(queue_, pixels, "T"), n(queue_, pixels, "counts");
    Buffer<cl_int> ends(queue_, pixels, "ends");
    const size_t groups = size_t((width + 15) / 16) * size_t((height + 15) / 16);
    const Range range = Range::groups(groups, queue_.lanes == 1 ? 256 : 1);
    const auto walk = [&](auto& kernel) {
      kernel(queue_, range, width, height, splats.records, tiles.tile_offsets, tiles.isect_ids,
             tiles.masks, T, ends, n);
      return n.read(queue_);
    };
    const std::vector<float> there = walk(forward_);
    const std::vector<float> passed = T.read(queue_), drawn = images.transmittance.read(queue_);
    counts.other_images += double(ends.read(queue_) != images.ends.read(queue_));
    const std::vector<float> back = walk(backward_), front = T.read(queue_);
    for (size_t i = 0; i < pixels; ++i) {
      counts.mismatches += there[i] != back[i];
      counts.other_images += passed[i] != drawn[i];
      counts.contributors += double(there[i]);
      counts.off_front = worse(counts.off_front, std::fabs(double(front[i]) - 1));
    }
    counts.pixel_splats += 256. * double(tiles.intersections);
  }

 private:
  Queue& queue_;
  Program program_;
  Kernel<cl_int, cl_int, In<float>, In<cl_uint>, In<cl_uint>, In<cl_ushort>, Out<float>,
         Out<cl_int>, Out<float>>
      forward_, backward_;
};

Rows agreement(Queue& queue, double pixel_splats) {
  Replay replay(queue);
  Replay::Counts counts;
  for (unsigned seed = 1; counts.pixel_splats < pixel_splats; ++seed) {
    SceneSpec spec;
    spec.n = 8000;
    spec.width = 640;
    spec.height = 480;
    spec.seed = seed;
    spec.cover = 100;
    spec.opaque = .05;
    replay.compare(random_scene(spec), counts);
  }
  const std::string of = fmt::format(
      "{:.1e} pixel-splats, {:.1e} contribute: ", counts.pixel_splats, counts.contributors);
  return {{of + "mismatches", counts.mismatches, 0},
          {of + "T or its end differs from forward", counts.other_images, 0},
          {of + "T in front, backward pass, vs 1", counts.off_front, 1e-5}};
}

}  // namespace

Tests replay_tests() {
  return {{"T18", "forward and backward agree", true, [](Queue& q) { return agreement(q, 1e8); }}};
}

}  // namespace gflow::stress
