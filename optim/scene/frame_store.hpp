// SPDX-License-Identifier: Apache-2.0
// Images of a scene on demand: decoded, masked, undistorted, reduced, composited over the
// background, and cached within a memory bound. A background thread decodes prefetched frames. All
// methods are thread-safe. Video frames are unpacked to files once, because only sequential
// decoding finds a given frame in every container.
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
  std::array<uint8_t, 3> background = {255, 255, 255};  // sRGB, behind images with alpha
  size_t cache_bytes = size_t{1} << 30;  // decoded images kept; least recently used evicted first
  std::string unpack_folder;  // folder of unpacked video frames (reduced, PNG); empty: a temporary
                              // folder, removed with the store
};

class FrameStore {
 public:
  // Checks that image files and masks have the size of their camera (reads headers only). Copies
  // the cameras; frames passed later must be of this scene.
  explicit FrameStore(const Scene& scene, const FrameStoreOptions& options = {});
  ~FrameStore();
  FrameStore(const FrameStore&) = delete;
  FrameStore& operator=(const FrameStore&) = delete;

  // RGB over the background, in the size of camera(frame). Error if the image cannot be decoded or
  // has another size than its camera.
  std::shared_ptr<const Image> rgb(const Frame& frame);

  // Alpha as a one-channel image; null if the image has no alpha.
  std::shared_ptr<const Image> alpha(const Frame& frame);

  // One channel, 0 where a pixel takes no part in losses and metrics, else 255; null if all pixels
  // count (Masks::ignore).
  std::shared_ptr<const Image> counted(const Frame& frame);

  // One channel, 0 in the background, else 255; null without a mask of the foreground
  // (Masks::foreground).
  std::shared_ptr<const Image> foreground(const Frame& frame);

  // The background of rgb().
  std::array<uint8_t, 3> background() const;

  // Like rgb(), but without the background: RGBA if the image has alpha, else the same as rgb().
  std::shared_ptr<const Image> image(const Frame& frame);

  // RGB over another background.
  Image rgb_over(const Frame& frame, std::array<uint8_t, 3> background);

  // Queues frames for the background thread, in order; replaces frames queued before but not
  // started. Failures are reported by rgb().
  void prefetch(const std::vector<const Frame*>& frames);

  // The camera of a frame, or all cameras, at the store's resolution. Not while another thread
  // moves a camera.
  const Camera& camera(const Frame& frame) const;
  const std::vector<Camera>& cameras() const;
  // Gives a camera, by its index in the scene, another pose, and its focal lengths this multiple of
  // those of the scene. Images stay as they are.
  void move_camera(size_t index, const Eigen::Matrix4d& viewmat, double focal = 1);
  // The scene's cameras, in full resolution, as they have been moved.
  std::vector<Camera> moved_cameras() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
