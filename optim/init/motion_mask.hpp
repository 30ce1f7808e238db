// SPDX-License-Identifier: Apache-2.0
// Motion masks of static cameras, and focus regions: the parts of images that training samples more
// often.
#pragma once
#include <map>
#include <memory>
#include <vector>

#include "optim/images/rect.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// A static camera and its frames.
struct StaticCamera {
  Camera camera;
  std::vector<const Frame*> frames;  // in order of time
  std::vector<uint8_t> usual;        // [H, W, 3] median image, over at most 25 frames
};

// The cameras of scene.train that are static over at least four time steps.
std::vector<StaticCamera> static_cameras_of(const Scene& scene, FrameStore& store);

// Whether two colours differ by more than noise.
bool differs(const uint8_t* rgb, const uint8_t* usual);

// Motion mask [H, W]: 1 at pixels that differ from the median image by more than noise, and next to
// them.
std::vector<uint8_t> changed_pixels(const Image& image, const std::vector<uint8_t>& usual);
// The same for a frame; pixels that do not count (FrameStore::counted) have not changed.
std::vector<uint8_t> changed_pixels(FrameStore& store, const Frame& frame,
                                    const std::vector<uint8_t>& usual);

// Rectangle around the pixels above 0, with a margin; empty if there are too few.
Rect region_around(const Image& mask);

// Focus region of each training frame, with a margin: around the motion mask of a static camera, or
// around the object in an image with transparency. The whole image if neither is known; empty if
// nothing changes. Sides are multiples of 16 if the image is large enough.
std::vector<Rect> parts_of_interest(const Scene& scene, FrameStore& store,
                                    const std::vector<StaticCamera>& static_cameras);

}  // namespace gflow
