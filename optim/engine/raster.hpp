// SPDX-License-Identifier: Apache-2.0
// The program of kernels/engine/raster.cl for these settings, shared by projection and splatting.
#pragma once
#include "optim/engine/settings.hpp"
#include "runtime/cl/program.hpp"

namespace gflow {

inline Program raster_program(Queue& queue, const EngineSettings& settings, Channels channels) {
  return {queue, "engine/raster.cl",
          with_more(Defines{{"FLOW", int(channels.flow)},
                            {"DEPTH", int(channels.depth)},
                            {"TRANSPORT", int(settings.transport)},
                            {"DETACH_T1", int(settings.detach_t1)},
                            {"TOP_K", channels.flow ? settings.top_k : 0},
                            {"DETACH_WEIGHTS", int(channels.flow && settings.detach_weights)},
                            {"EXCLUDE", int(settings.stop == StopRule::exclude)},
                            {"ABSGRAD", int(absgrad(settings, channels))},
                            {"TIGHT_BOXES", int(settings.skip.boxes)},
                            {"SATURATED", int(settings.skip.saturated)},
                            {"ASKING", int(settings.skip.zero_gradients)}},
                    settings)};
}

}  // namespace gflow
