// SPDX-License-Identifier: Apache-2.0
// Known views in a folder of images and, optionally, flows:
//
//   CAMERA/                     images in natural order of names, one per time step
//   flow/CAMERA/NNNN.flo[.gz]   flow from time step NNNN to the next, NNNN_mask.png (see Scene)
//   *.png, *.jpg                images of any view at any time
//
// Images with alpha are composited over the request's background.
#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "optim/flow/optical_flow.hpp"
#include "optim/guidance/guidance.hpp"
#include "optim/images/image.hpp"
#include "optim/images/lru_cache.hpp"

namespace gflow {

class KnownViews {
 public:
  // Error if neither the folder nor its subfolders have images.
  explicit KnownViews(const std::string& folder);

  // Planes [3, H, W] in [0, 1] in the size of the view. If `of_camera` is set and the folder has
  // the view's camera: that camera's image at the request's time. Otherwise all images of that
  // time. GuidanceFailed if there is none, or its aspect ratio differs from the view's.
  std::vector<std::vector<float>> images(const GuidanceRequest& request, const GuidanceView& view,
                                         bool of_camera) const;
  // Flow of the view's camera from the request's time step, in the size of the view; nullptr if
  // there is none.
  std::shared_ptr<const TargetFlow> flow(const GuidanceRequest& request,
                                         const GuidanceView& view) const;

 private:
  std::vector<float> planes(const std::string& path, const GuidanceRequest& request,
                            const GuidanceView& view) const;

  std::string folder_;
  std::map<std::string, std::vector<std::string>> of_cameras_;  // paths, one per time step
  std::vector<std::string> of_any_;
  mutable LruCache<std::string, Image> images_;  // decoded
  mutable LruCache<std::string, TargetFlow> flows_;
};

}  // namespace gflow
