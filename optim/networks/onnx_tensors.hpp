// SPDX-License-Identifier: Apache-2.0
// Checks that the tensors of an ONNX file have as many values as they state. OpenCV does not check
// that and would read out of bounds.
#pragma once
#include <string>
#include <string_view>

namespace gflow {

// `model`: the bytes of the file at `path`. Error if a tensor (weights or a node attribute) states
// another number of values than it has or keeps them in another file. DamagedMessage if the bytes
// are not a model, or a tensor has more dimensions or elements than OpenCV supports.
void require_sound_tensors(std::string_view model, const std::string& path);

}  // namespace gflow
