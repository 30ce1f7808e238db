// SPDX-License-Identifier: Apache-2.0
// NumPy archives: a zip file with one .npy per named array. Reads files of np.savez and
// np.savez_compressed and checks their CRC-32; np.load reads the files written here.
#pragma once
#include <fmt/format.h>

#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <string_view>

#include "optim/formats/npy.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {

using Arrays = std::map<std::string, Array>;

// Reads the arrays of an archive by name (without ".npy"). If `only` is not empty, other arrays are
// skipped. `always` [bytes] is the unpacked size accepted whatever the file size, as in
// require_plausible_size. Error if the file is missing or damaged, or an entry is not an array that
// gflow reads.
Arrays read_npz(const std::string& path, const std::set<std::string>& only = {},
                size_t always = always_plausible);

// Names of all arrays of an archive (without ".npy"), without reading their values. Errors as
// read_npz.
std::vector<std::string> names_in_npz(const std::string& path);

// deflated: a third smaller for trained parameters and moments. stored: thirty times faster to
// write.
enum class Packing { deflated, stored };

// Writes all arrays; replaces the file atomically.
void write_npz(const std::string& path, const Arrays& arrays, Packing packing = Packing::deflated);

// The array with this name. Error if it is absent; lists the file and the arrays it has.
const Array& array_named(const Arrays& arrays, std::string_view name, const std::string& path);

// The values of an array. Error if it is absent, its type is not T, or its shape differs.
template <class T>
const std::vector<T>& exact_values(const Arrays& arrays, std::string_view name,
                                   const std::vector<size_t>& shape, const std::string& path) {
  const Array& array = array_named(arrays, name, path);
  const auto* values = std::get_if<std::vector<T>>(&array.values);
  if (!values || array.shape != shape)
    throw Error(fmt::format("{}: array '{}' has shape {}{}, expected ({})", path, name,
                            array.shape_text(), values ? "" : " and another number type",
                            fmt::join(shape, ", ")));
  return *values;
}

// The same for a shape in braces: gcc 14 warns that the result may refer to a temporary vector.
template <class T>
const std::vector<T>& exact_values(const Arrays& arrays, std::string_view name,
                                   std::initializer_list<size_t> shape, const std::string& path) {
  return exact_values<T>(arrays, name, std::vector<size_t>(shape), path);
}

}  // namespace gflow
