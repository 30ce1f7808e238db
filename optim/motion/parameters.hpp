// SPDX-License-Identifier: Apache-2.0
// All arrays that training changes, by name: one row a Gaussian, one group an array. Losses,
// density control, files and Adam go over the groups and need not know the motion model.
#pragma once
#include <string>
#include <vector>

#include "runtime/adam.hpp"

namespace gflow {

// What a group's values are; says at which rate they learn.
enum class Quantity { position, time, rotation, scale, opacity, color, color_rest };

// A group's name and width, e.g. {"means", 3}.
struct GroupSpec {
  std::string name;
  size_t width;
  Quantity quantity = Quantity::position;
  int per_time = 0;  // 1 for its change in a unit of time (a velocity), 2 for that of its change
};

class Parameters {
 public:
  // `count` rows of undefined values, zero gradients and moments.
  Parameters(Queue& queue, size_t count, std::vector<GroupSpec> specs)
      : count(count), specs(std::move(specs)), rows(queue, count) {
    groups.reserve(this->specs.size());
    for (const GroupSpec& spec : this->specs)
      groups.emplace_back(queue, spec.name, count, spec.width);
  }

  // Error when there is no such group.
  ParameterGroup& operator[](const std::string& name) { return groups[index_of(name)]; }
  const ParameterGroup& operator[](const std::string& name) const { return groups[index_of(name)]; }
  bool has(const std::string& name) const {
    for (const GroupSpec& spec : specs)
      if (spec.name == name) return true;
    return false;
  }

  size_t count;  // N
  std::vector<GroupSpec> specs;
  std::vector<ParameterGroup> groups;  // as specs
  RowState rows;

 private:
  size_t index_of(const std::string& name) const {
    for (size_t i = 0; i < specs.size(); ++i)
      if (specs[i].name == name) return i;
    throw Error("there is no parameter group '" + name + "' in this model");
  }
};

}  // namespace gflow
