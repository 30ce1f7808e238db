// SPDX-License-Identifier: Apache-2.0
// Whether tensors in a .onnx file hold as many numbers as they say. OpenCV, which reads them, does
// not look: it would read past their end.
#pragma once
#include <string>
#include <string_view>

namespace gflow {

// The bytes of a model, the file at `path`. Error when a tensor of it, weights or an attribute of a
// node, says that it has more or fewer numbers than it has, keeps them in another file, or is of
// more sizes or a larger one than OpenCV takes. DamagedMessage where the bytes are no model.
void require_sound_tensors(std::string_view model, const std::string& path);

}  // namespace gflow
