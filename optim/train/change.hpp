// SPDX-License-Identifier: Apache-2.0
// Where pictures of fixed cameras change over time, and where pictures with alpha show anything:
// what training should look at more often than at the rest.
#pragma once
#include <map>
#include <memory>
#include <vector>

#include "optim/data/frame_store.hpp"

namespace gflow {

// One fixed camera over time.
struct Watcher {
  Camera camera;
  std::vector<const Frame*> frames;  // by time
  std::vector<std::shared_ptr<const Image>> pictures;
  std::vector<std::vector<uint8_t>> changed;  // [H, W] a frame: 1 where it differs from the median
};

// The cameras of scene.train that stand still over at least four steps. Holds all their pictures.
std::vector<Watcher> watchers_of(const Scene& scene, FrameStore& store);

// A part of a picture [px].
struct Rect {
  int x = 0, y = 0, width = 0, height = 0;
};

// The part of each training frame worth a closer look, with a margin: around what changes at a fixed
// camera, or around what is not transparent. The whole picture where neither is known; empty where
// nothing changes. Sides are multiples of 16 where the picture allows it.
std::vector<Rect> parts_of_interest(const Scene& scene, FrameStore& store,
                                    const std::vector<Watcher>& watchers);

}  // namespace gflow
