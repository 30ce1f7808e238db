// SPDX-License-Identifier: Apache-2.0
// NumPy archives: a zip file with one .npy for each named array. np.savez and np.savez_compressed
// files are both read; ours are deflated and np.load reads them.
#pragma once
#include <map>
#include <string>

#include "optim/io/npy.hpp"

namespace gflow {

using Arrays = std::map<std::string, Array>;

// All arrays of an archive by name (without ".npy"). Error when it is missing, damaged, or when an
// entry is no array that gflow reads.
Arrays read_npz(const std::string& path);

// Writes all arrays; the file appears complete or not at all.
void write_npz(const std::string& path, const Arrays& arrays);

// The array of that name. Error when it is absent, naming the file and the arrays it has.
const Array& array_named(const Arrays& arrays, const std::string& name, const std::string& path);

}  // namespace gflow
