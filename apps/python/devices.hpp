// SPDX-License-Identifier: Apache-2.0
// The device that this process renders on, and what its rasterizations reuse. Opened and
// self-checked at first use, as by the command line.
#pragma once
#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "optim/engine/camera_gradient.hpp"
#include "optim/engine/engine.hpp"
#include "optim/engine/posed.hpp"
#include "optim/motion/color.hpp"

namespace gflow::python {

// One opened device. Whoever queues work holds `mutex`, without holding Python's lock meanwhile: a
// thread with Python's lock that waits for `mutex` could wait for ever.
class Device {
 public:
  explicit Device(Queue queue);

  // An engine with these settings, whose programs may already be built. It goes back to this
  // device, which keeps its buffers for the next one, when it is destroyed.
  struct GiveBack {
    Device* device = nullptr;
    std::string key;
    void operator()(Engine* engine) const { device->take_back(key, engine); }
  };
  using EngineLoan = std::unique_ptr<Engine, GiveBack>;
  EngineLoan engine(const EngineSettings& settings);

  // Colours of spherical harmonics up to `degree`, 0 to 3.
  Color& color(int degree);

  Queue queue;
  std::mutex mutex;
  Posed posed;
  CameraGradients camera_gradients;
  // Scratch memory of one backward pass.
  ImageGradients v_images;
  GaussianGradients gradients, through_direction;
  Buffer<float> v_quats{"v_quats"}, v_scales{"v_scales"};

 private:
  void take_back(const std::string& key, Engine* engine);

  std::array<std::unique_ptr<Color>, 4> colors_;
  std::mutex idle_mutex_;  // held for moments only, so also by threads with Python's lock
  std::multimap<std::string, std::unique_ptr<Engine>> idle_;
};

// The chosen device. Throws NoUsableDevice as the command line does, and an Error in a process
// that was forked from one with an open device, which OpenCL does not survive.
Device& current_device();

// Chooses the device of later calls by index or part of its name ("": GFLOW_DEVICE, the first GPU
// or the first device) and opens it. Errors as current_device(), then the choice stays as it was.
void choose_device(const std::string& wanted);

}  // namespace gflow::python
