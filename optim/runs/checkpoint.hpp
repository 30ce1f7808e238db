// SPDX-License-Identifier: Apache-2.0
// Checkpoint: the state of a training run after a step, from which a later process continues with
// bitwise equal results. Random numbers are functions of seed and step, so there is no generator
// state.
//
// The file is an uncompressed NumPy archive: the arrays of Trainer::state and `facts`, a JSON text
// as bytes that lists the arrays with their shapes. Every array has a CRC-32.
#pragma once
#include <optional>
#include <string>

#include "optim/formats/npz.hpp"
#include "optim/model/model.hpp"
#include "runtime/cl/queue.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// What decides whether training may continue, and whether bitwise equally.
struct CheckpointFacts {
  int step = 0;         // steps made, so the number of the next step
  double seconds = 0;   // training time so far
  std::string config;   // all settings, as TOML
  std::string scene;    // fingerprint of the training data
  std::string device;   // name, driver and lanes
  std::string program;  // fingerprint of the writing program
  // Shape of the model; none in checkpoints of older versions of gflow.
  std::optional<ModelShape> shape = {};
};

struct Checkpoint {
  CheckpointFacts facts;
  Arrays arrays;
};

// The file appears complete or not at all. Error if it cannot be written.
void write_checkpoint(const std::string& path, const Checkpoint& checkpoint);
// Error with the reason if it is not a checkpoint, is damaged, or has another format.
Checkpoint read_checkpoint(const std::string& path);

// The facts alone, without reading the arrays. Error as read_checkpoint.
CheckpointFacts read_checkpoint_facts(const std::string& path);

// CRC-32 of bytes as eight hexadecimal digits.
std::string crc32_text(const void* bytes, size_t length);
// Entries of CheckpointFacts for this device and this program.
std::string device_stamp(const DeviceInfo& device);
std::string program_stamp();

// N of a name iteration_N, else -1, also for iteration_07.
int iteration_of_name(const std::string& name);

// The last two checkpoints of a run, FOLDER/iteration_N.npz.
class CheckpointFolder {
 public:
  explicit CheckpointFolder(std::string folder) : folder_(std::move(folder)) {}

  struct Found {
    std::string path;
    Checkpoint checkpoint;
  };

  std::string path(int step) const;
  // Writes a checkpoint and keeps only the last one before it. Calls make_room() if the disk is
  // full. Error if it cannot be written; then the last earlier one remains.
  void write(const Checkpoint& checkpoint) const;
  // Makes room for something later than all checkpoints, after `problem`: removes all but the last
  // readable one and warns. Returns whether any was removed.
  bool make_room(const DiskFull& problem) const;
  // The last readable checkpoint, or none if the folder has none; warns of unreadable ones. Error
  // if there are some and none is readable.
  std::optional<Found> latest() const;
  // Steps of the files, descending.
  std::vector<int> steps() const;

 private:
  std::string folder_;
};

}  // namespace gflow
