// SPDX-License-Identifier: Apache-2.0
// Checks of a web page as a whole.
#pragma once
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <string>
#include <vector>

namespace gflow {

// Expects that every element is closed in its order, and that no attribute or text has a stray <.
inline void expect_balanced(const std::string& page) {
  static const std::set<std::string> empty{"meta", "img", "!DOCTYPE", "ellipse", "path", "rect"};
  // Script and style end at their own end tags only.
  const std::string markup =
      std::regex_replace(page, std::regex("<(style|script)>[^<]*</(style|script)>"), "");
  static const std::regex tag(R"~(<(/?)([!A-Za-z][A-Za-z0-9]*)((?:[^<>"]|"[^"]*")*)>|<)~");
  std::vector<std::string> open;
  for (std::sregex_iterator found(markup.begin(), markup.end(), tag), end; found != end; ++found) {
    const std::string name = (*found)[2], rest = (*found)[3];
    ASSERT_NE(name, "") << "stray < before: " << markup.substr(size_t(found->position()), 60);
    if ((*found)[1] == "/") {
      ASSERT_FALSE(open.empty()) << name;
      ASSERT_EQ(open.back(), name) << markup.substr(size_t(found->position()), 60);
      open.pop_back();
    } else if (!empty.count(name) && (rest.empty() || rest.back() != '/')) {
      open.push_back(name);
    }
  }
  EXPECT_TRUE(open.empty()) << open.back();
}

// Expects that nothing is loaded from elsewhere.
inline void expect_self_contained(const std::string& page) {
  for (const char* word : {"http://", "https://", "<link", "@import", "url(", "<iframe"})
    EXPECT_EQ(page.find(word), std::string::npos) << word;
  static const std::regex source(R"~((?:src|href)="([^"]{0,11}))~");
  for (std::sregex_iterator found(page.begin(), page.end(), source), end; found != end; ++found)
    EXPECT_EQ((*found)[1], "data:image/");
}

}  // namespace gflow
