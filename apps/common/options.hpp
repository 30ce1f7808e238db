// SPDX-License-Identifier: Apache-2.0
// What every sub-command shares: the options that stand before or behind its name, and the way to a
// checked device.
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

// There is no device, none as asked for, or the one meant cannot be trusted. Exit code 2.
struct NoUsableDevice : Error {
  using Error::Error;
};

// The device meant by the options, after the self-check. NoUsableDevice with the reason if it has
// none or fails.
Queue open_queue(const GlobalOptions& options, const QueueOptions& queue_options = {});

// Each registers one sub-command with its options and what it runs; options must outlive app.
void add_bench(CLI::App& app, const GlobalOptions& options);
void add_devices(CLI::App& app, const GlobalOptions& options);
void add_splat(CLI::App& app, const GlobalOptions& options);
void add_stress(CLI::App& app, const GlobalOptions& options);
void add_import(CLI::App& app, const GlobalOptions& options);
void add_train(CLI::App& app, const GlobalOptions& options);  // these need OpenCV
void add_settings(CLI::App& app, const GlobalOptions& options);
void add_render(CLI::App& app, const GlobalOptions& options);
void add_export(CLI::App& app, const GlobalOptions& options);
void add_info(CLI::App& app, const GlobalOptions& options);
void add_eval(CLI::App& app, const GlobalOptions& options);
void add_experiment(CLI::App& app, const GlobalOptions& options);

}  // namespace gflow
