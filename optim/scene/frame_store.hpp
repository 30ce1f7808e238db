// SPDX-License-Identifier: Apache-2.0
// Pictures of a scene on demand: decoded, masked, undistorted, reduced, put on the background, and
// kept within a memory bound. A background thread decodes what is asked for ahead of time. All
// methods may be called from several threads. Video frames are unpacked to files once, since
// stepping through a video is the only way to a certain frame that holds for every container.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "optim/images/image.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

struct FrameStoreOptions {
  int resolution = 1;                                   // divisor of width and height
  std::array<uint8_t, 3> background = {255, 255, 255};  // behind pictures with alpha, sRGB
  size_t cache_bytes = size_t{1} << 30;                 // decoded pictures kept; oldest go first
  std::string unpack_folder;  // reduced video frames are kept here as PNG; empty: in a temporary
                              // folder, gone with the store
};

class FrameStore {
 public:
  // Checks that pictures that are files, and masks, have the size of their camera (headers only).
  // The cameras are copied; frames given later must be of this scene.
  explicit FrameStore(const Scene& scene, const FrameStoreOptions& options = {});
  ~FrameStore();
  FrameStore(const FrameStore&) = delete;
  FrameStore& operator=(const FrameStore&) = delete;

  // The picture of a frame on the background, RGB, in the size of camera(frame). Error when it
  // cannot be decoded or has another size than its camera.
  std::shared_ptr<const Image> rgb(const Frame& frame);

  // Its alpha as a one-channel picture; null when the picture has none.
  std::shared_ptr<const Image> alpha(const Frame& frame);

  // Behind rgb().
  std::array<uint8_t, 3> background() const;

  // The picture before any background: RGBA where it has alpha, else RGB.
  std::shared_ptr<const Image> picture(const Frame& frame);

  // RGB before another background.
  Image rgb_over(const Frame& frame, std::array<uint8_t, 3> background);

  // Asks the background thread to decode these, in order, instead of what it has not begun yet.
  // Frames that fail are left for rgb() to report.
  void prefetch(const std::vector<const Frame*>& frames);

  // The camera of a frame, or all, at the store's resolution.
  const Camera& camera(const Frame& frame) const;
  const std::vector<Camera>& cameras() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
