// SPDX-License-Identifier: Apache-2.0
// A training as it stands after a step, in a file, so that a later process goes on from there with
// the same bits. Random numbers are functions of seed and step: there is no generator to keep.
//
// The file is a NumPy archive, not compressed: the arrays of Trainer::state and `facts`, a JSON
// text as bytes, which lists the arrays with their shapes. Every array has a CRC-32.
#pragma once
#include <optional>
#include <string>

#include "optim/formats/npz.hpp"
#include "optim/model/model.hpp"
#include "runtime/cl/queue.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// What decides whether training may go on, and whether bit by bit.
struct CheckpointFacts {
  int step = 0;         // steps made; the next one has this number
  double seconds = 0;   // of training so far
  std::string config;   // every setting, as TOML
  std::string scene;    // fingerprint of what was trained on
  std::string device;   // with driver and lanes
  std::string program;  // fingerprint of the program that wrote it
  // Of the model, but for what only training needs; none in checkpoints of an older gflow.
  std::optional<ModelShape> shape = {};
};

struct Checkpoint {
  CheckpointFacts facts;
  Arrays arrays;
};

// The file appears complete or not at all. Error when it cannot be written.
void write_checkpoint(const std::string& path, const Checkpoint& checkpoint);
// Error with the reason when it is no checkpoint, damaged, or of another format.
Checkpoint read_checkpoint(const std::string& path);

// The facts alone, of whatever arrays, without reading those. Error as read_checkpoint.
CheckpointFacts read_checkpoint_facts(const std::string& path);

// CRC-32 of some bytes as eight hexadecimal digits.
std::string crc32_text(const void* bytes, size_t length);
// What `facts` say of this device and this program.
std::string device_stamp(const DeviceInfo& device);
std::string program_stamp();

// N of a name iteration_N, and -1 of any other: of a copy called iteration_07, too.
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
  // Writes one and keeps, beside it, the last before it only. Where the disk is full, make_room()
  // helps. Error when it cannot be written; then the last of those that were there remains.
  void write(const Checkpoint& checkpoint) const;
  // Before something later than all of them is written where there is no room for it, as `problem`
  // says: removes all but the last that can be read, which is warned of. Whether any was removed.
  bool make_room(const DiskFull& problem) const;
  // The last one that can be read, none when the folder has no checkpoints; warns of those that
  // cannot. Error when there are some and none can be read.
  std::optional<Found> latest() const;
  // Steps of the files, falling.
  std::vector<int> steps() const;

 private:
  std::string folder_;
};

}  // namespace gflow
