// SPDX-License-Identifier: Apache-2.0
// T18: whether the forward and the backward pass agree, at every pixel and to the bit, on who
// counts and on what passes through.
#include "apps/stress/figures.hpp"
#include "apps/stress/stress.hpp"
#include "tests/device_scene.hpp"

namespace gflow::stress {
namespace {

// kernels/stress_replay.cl walks the lists of a drawn image as splat.cl and as splat_bwd.cl do.
class Replay {
 public:
  explicit Replay(Queue& queue)
      : queue_(queue),
        program_(queue, "stress_replay.cl"),
        forward_(program_, "replay_fwd"),
        backward_(program_, "replay_bwd") {}

  struct Counts {
    double pixel_splats = 0, contributors = 0, mismatches = 0, other_images = 0;
  };
  void compare(const PosedScene& s, Counts& counts) {
    DeviceScene device(queue_, s, {false, false});
    const std::vector<float> drawn = device.forward().at("transmittance");
    const Splats& splats = device.engine.splats();
    const Tiles& tiles = device.engine.tiles();
    const size_t pixels = s.pixels();
    const int width = s.shot.camera.width, height = s.shot.camera.height;
    Buffer<float> t1(queue_, pixels, "T forward"), t2(queue_, pixels, "T backward");
    Buffer<float> n1(queue_, pixels, "count forward"), n2(queue_, pixels, "count backward");
    const size_t groups = size_t((width + 15) / 16) * size_t((height + 15) / 16);
    const Range range = Range::groups(groups, queue_.lanes == 1 ? 256 : 1);
    forward_(queue_, range, width, height, splats.records, tiles.tile_offsets, tiles.isect_ids,
             tiles.masks, t1, n1);
    backward_(queue_, range, width, height, splats.records, tiles.tile_offsets, tiles.isect_ids,
              tiles.masks, t2, n2);
    const std::vector<float> a = t1.read(queue_), b = t2.read(queue_);
    const std::vector<float> m = n1.read(queue_), n = n2.read(queue_);
    for (size_t i = 0; i < pixels; ++i) {
      counts.mismatches += a[i] != b[i] || m[i] != n[i];
      counts.other_images += a[i] != drawn[i];
      counts.contributors += double(m[i]);
    }
    counts.pixel_splats += 256. * double(tiles.intersections);
  }

 private:
  Queue& queue_;
  Program program_;
  Kernel<cl_int, cl_int, In<float>, In<cl_uint>, In<cl_uint>, In<cl_ushort>, Out<float>, Out<float>>
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
      "of {:.1e} pixel-splats, {:.1e} counting: ", counts.pixel_splats, counts.contributors);
  return {{of + "mismatches", counts.mismatches, 0},
          {of + "T other than drawn", counts.other_images, 0}};
}

}  // namespace

Tests replay_tests() {
  return {{"T18", "forward and backward agree", true, [](Queue& q) { return agreement(q, 1e8); }}};
}

}  // namespace gflow::stress
