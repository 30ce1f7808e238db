// SPDX-License-Identifier: Apache-2.0
// NumPy archives: a zip file with one .npy for each named array. np.savez and np.savez_compressed
// files are both read, and np.load reads ours. Each array has a CRC-32, which reading checks.
#pragma once
#include <fmt/format.h>

#include <map>
#include <set>
#include <string>

#include "optim/formats/npy.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {

using Arrays = std::map<std::string, Array>;

// All arrays of an archive by name (without ".npy"). Error when it is missing, damaged, or when an
// entry is no array that gflow reads. `only`: unless empty, the others are not read. `always`: what
// they may hold however small the file is, as for require_plausible_size [bytes].
Arrays read_npz(const std::string& path, const std::set<std::string>& only = {},
                size_t always = always_plausible);

// Names of all arrays of an archive (without ".npy"), none of which is read. Error as above.
std::vector<std::string> names_in_npz(const std::string& path);

// Deflating trained parameters and their moments saves a third of the space and takes thirty times
// as long.
enum class Packing { deflated, stored };

// Writes all arrays; the file appears complete or not at all.
void write_npz(const std::string& path, const Arrays& arrays, Packing packing = Packing::deflated);

// The array of that name. Error when it is absent, naming the file and the arrays it has.
const Array& array_named(const Arrays& arrays, const std::string& name, const std::string& path);

// Its values. Error also when their type is not T or the shape is another.
template <class T>
const std::vector<T>& exact_values(const Arrays& arrays, const std::string& name,
                                   const std::vector<size_t>& shape, const std::string& path) {
  const Array& array = array_named(arrays, name, path);
  const auto* values = std::get_if<std::vector<T>>(&array.values);
  if (!values || array.shape != shape)
    throw Error(fmt::format("{}: array '{}' is {}{}, expected is ({})", path, name,
                            array.shape_text(), values ? "" : " of another number type",
                            fmt::join(shape, ", ")));
  return *values;
}

}  // namespace gflow
