// SPDX-License-Identifier: Apache-2.0
// Numbers that a motion model declares by itself: settings in a section of the model's name, which
// its files store as well.
#pragma once
#include <string>
#include <variant>
#include <vector>

#include "runtime/base/option.hpp"

namespace gflow {

// Declaration of one number. `value`: the default; its type is that of the setting.
struct OwnNumber {
  const char* key;
  std::variant<int, float> value;
  Help help;
  Allowed range;
};

// The numbers of a model with their values; none by default.
class OwnNumbers {
 public:
  OwnNumbers() = default;
  // With the defaults. `declared` must outlive it.
  explicit OwnNumbers(const std::vector<OwnNumber>& declared) : declared_(&declared) {
    for (const OwnNumber& number : declared) values_.push_back(number.value);
  }

  bool empty() const { return values_.empty(); }
  // Error if there is no number of that key and type.
  int whole(const std::string& key) const { return value<int>(key); }
  float real(const std::string& key) const { return value<float>(key); }

  // As the fields() of other settings (runtime/base/option.hpp).
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    for (size_t i = 0; i < self.values_.size(); ++i) {
      const OwnNumber& number = (*self.declared_)[i];
      std::visit([&](auto& value) { field(number.key, value, number.help, number.range); },
                 self.values_[i]);
    }
  }

 private:
  template <class Number>
  Number value(const std::string& key) const {
    for (size_t i = 0; i < values_.size(); ++i)
      if (key == (*declared_)[i].key) return std::get<Number>(values_[i]);
    throw Error("the motion model has no number named " + key);
  }

  const std::vector<OwnNumber>* declared_ = nullptr;
  std::vector<std::variant<int, float>> values_;  // as *declared_
};

}  // namespace gflow
