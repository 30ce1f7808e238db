// SPDX-License-Identifier: Apache-2.0
// Shared by all sub-commands: the global options, which may precede or follow the sub-command, and
// access to a checked device.
#pragma once
#include <string>

#include "runtime/cl/queue.hpp"

namespace CLI {
class App;
}

namespace gflow {

struct GlobalOptions {
  std::string device;  // index or part of "platform / name"; empty: GFLOW_DEVICE, else the default
  bool quiet = false;  // no progress on stderr
};

// No device, none that matches --device, or one that fails its self-check. Exit code 2.
struct NoUsableDevice : Error {
  using Error::Error;
};

// Opens the device that the options select, after the self-check. Throws NoUsableDevice with the
// reason if there is none or it fails.
Queue open_queue(const GlobalOptions& options, const QueueOptions& queue_options = {});

// Each registers one sub-command. `options` must outlive `app`.
void add_bench(CLI::App& app, const GlobalOptions& options);
void add_completion(CLI::App& app, const GlobalOptions& options);
void add_devices(CLI::App& app, const GlobalOptions& options);
void add_splat(CLI::App& app, const GlobalOptions& options);
void add_stress(CLI::App& app, const GlobalOptions& options);
void add_import(CLI::App& app, const GlobalOptions& options);
void add_cameras(CLI::App& app, const GlobalOptions& options);  // these need OpenCV
void add_train(CLI::App& app, const GlobalOptions& options);
void add_settings(CLI::App& app, const GlobalOptions& options);
void add_render(CLI::App& app, const GlobalOptions& options);
void add_view(CLI::App& app, const GlobalOptions& options);
void add_export(CLI::App& app, const GlobalOptions& options);
void add_info(CLI::App& app, const GlobalOptions& options);
void add_eval(CLI::App& app, const GlobalOptions& options);
void add_experiment(CLI::App& app, const GlobalOptions& options);

}  // namespace gflow
