// SPDX-License-Identifier: Apache-2.0
// A folder with pictures, and if there are any flows, of known views:
//
//   CAMERA/           pictures in natural order of their names, one a time step
//   flow/CAMERA/NNNN.flo[.gz]   flow from time step NNNN to the next, NNNN_mask.png (see Scene)
//   *.png, *.jpg      pictures that may be any view's, at any time
//
// Pictures with alpha are put on the background that is drawn.
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
  // Error when the folder has no pictures in it or in its folders.
  explicit KnownViews(const std::string& folder);

  // Planes [3, H, W] in [0, 1] in the size of the view: the picture of its camera at the request's
  // time where `of_camera` and the folder knows that camera; else all pictures of that time.
  // GuidanceFailed when there is none, or one has another shape than the view.
  std::vector<std::vector<float>> pictures(const GuidanceRequest& request, const GuidanceView& view,
                                           bool of_camera) const;
  // The flow of the view's camera from the request's time step, in its size; nullptr when there is
  // none.
  std::shared_ptr<const TeacherFlow> flow(const GuidanceRequest& request,
                                          const GuidanceView& view) const;

 private:
  std::vector<float> planes(const std::string& path, const GuidanceRequest& request,
                            const GuidanceView& view) const;

  std::string folder_;
  std::map<std::string, std::vector<std::string>> of_cameras_;  // paths, one a time step
  std::vector<std::string> of_any_;
  mutable LruCache<std::string, Image> images_;  // decoded
  mutable LruCache<std::string, TeacherFlow> flows_;
};

}  // namespace gflow
