// SPDX-License-Identifier: Apache-2.0
// Times of images that are frames of videos but have none: by the numbers at the ends of their
// names.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/scene.hpp"

namespace gflow {

// Times in [0, 1] of images in natural order of their names, proportional to the numbers at the
// ends: a gap in the numbers is a gap in time. Evenly spaced if the numbers do not increase.
std::vector<double> times_of_names(const std::vector<std::string>& names);

// Sets Frame::time by the numbers in the file names, in [0, 1], and Frame::track: images of one
// folder with one name before the number are the video of one camera, and equal numbers are the
// same time. Error if a name has no number at its end; `source` lists the images.
void set_times_by_order(std::vector<Frame>& frames, const std::string& source);

// A notice if images without times are named like the frames of a video, so that the scene might be
// taken for a static one by mistake.
void report_video_names(const std::vector<Frame>& frames, const std::string& source,
                        std::vector<std::string>& notices);

}  // namespace gflow
