// SPDX-License-Identifier: Apache-2.0
// Where pictures of fixed cameras change over time, and where pictures with alpha show anything:
// what training should look at more often than at the rest.
#pragma once
#include <map>
#include <memory>
#include <vector>

#include "optim/scene/frame_store.hpp"

namespace gflow {

// One fixed camera over time.
struct StaticCamera {
  Camera camera;
  std::vector<const Frame*> frames;  // by time
  std::vector<uint8_t> usual;        // [H, W, 3] median over at most 25 of them
};

// The cameras of scene.train that stand still over at least four steps.
std::vector<StaticCamera> static_cameras_of(const Scene& scene, FrameStore& store);

// Whether two colours differ by more than noise.
bool differs(const uint8_t* rgb, const uint8_t* usual);

// [H, W] 1 where a picture of the watcher differs from the usual by more than noise, or next to it.
std::vector<uint8_t> changed_pixels(const Image& picture, const std::vector<uint8_t>& usual);

// A part of a picture [px].
struct Rect {
  int x = 0, y = 0, width = 0, height = 0;
};

// The part of each training frame worth a closer look, with a margin: around what changes at a
// fixed camera, or around what stands out from the background of a picture with transparency. The
// whole picture where neither is known; empty where nothing changes. Sides are multiples of 16
// where the picture allows it.
std::vector<Rect> parts_of_interest(const Scene& scene, FrameStore& store,
                                    const std::vector<StaticCamera>& static_cameras);

}  // namespace gflow
