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

  // On loan from this device, which gets it back when the loan ends and lends it again: its memory
  // is not allocated anew.
  template <class T>
  struct GiveBack {
    Device* device = nullptr;
    std::string key;
    void operator()(T* lent) const { device->take_back(key, std::unique_ptr<T>(lent)); }
  };
  template <class T>
  using Loan = std::unique_ptr<T, GiveBack<T>>;

  // An engine with these settings.
  Loan<Engine> engine(const EngineSettings& settings);
  // Arrays for Gaussians at two times; of any size, contents are undefined.
  struct Gaussians {
    GaussiansAt t1, t2;
    Buffer<float> quats{"quats"}, scales{"scales"}, quats_t2{"quats_t2"}, scales_t2{"scales_t2"};
  };
  Loan<Gaussians> gaussians();

  // The contents of a buffer in `host`, until the next call.
  const float* read(const Buffer<float>& buffer);

  // Colours of spherical harmonics up to `degree`, 0 to 3.
  Color& color(int degree);

  Queue queue;
  std::mutex mutex;
  Posed posed;
  CameraGradients camera_gradients;
  // Scratch memory of one view.
  std::vector<float> host;
  ImageGradients v_images;
  GaussianGradients gradients, through_direction;
  Buffer<float> v_quats{"v_quats"}, v_scales{"v_scales"};

 private:
  void take_back(const std::string& key, std::unique_ptr<Engine> engine);
  void take_back(const std::string& key, std::unique_ptr<Gaussians> gaussians);

  std::array<std::unique_ptr<Color>, 4> colors_;
  std::mutex idle_mutex_;  // held for moments only, so also by threads with Python's lock
  std::multimap<std::string, std::unique_ptr<Engine>> idle_;
  std::vector<std::unique_ptr<Gaussians>> idle_gaussians_;
};

// The chosen device. Throws NoUsableDevice as the command line does, and an Error in a process
// that was forked from one with an open device, which OpenCL does not survive.
Device& current_device();

// Chooses the device of later calls by index or part of its name ("": GFLOW_DEVICE, the first GPU
// or the first device) and opens it. Errors as current_device(), then the choice stays as it was.
void choose_device(const std::string& wanted);

}  // namespace gflow::python
