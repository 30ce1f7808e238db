// SPDX-License-Identifier: Apache-2.0
// Checks of a web page as a whole. Written out, because std::regex recurses along long attributes.
#pragma once
#include <gtest/gtest.h>

#include <cctype>
#include <set>
#include <string>
#include <vector>

namespace gflow {

// The page without the contents of <style> and <script>, which end at their own end tags only.
inline std::string markup_of(std::string page) {
  for (const std::string name : {"style", "script"})
    for (size_t begin = 0; (begin = page.find("<" + name + ">", begin)) != std::string::npos;) {
      const size_t end = page.find("</" + name + ">", begin);
      if (end == std::string::npos) break;
      page.erase(begin, end + name.size() + 3 - begin);
    }
  return page;
}

// The end of the tag that begins at `at`, behind its >; npos if there is none. A > in quotes is not
// an end.
inline size_t end_of_tag(const std::string& page, size_t at) {
  for (bool quoted = false; at < page.size(); ++at) {
    if (page[at] == '"') quoted = !quoted;
    if (page[at] == '>' && !quoted) return at + 1;
  }
  return std::string::npos;
}

// Expects that every element is closed in its order, and that no < stands in texts or attributes.
inline void expect_balanced(const std::string& page) {
  static const std::set<std::string> empty{"meta", "img"};
  const std::string markup = markup_of(page);
  std::vector<std::string> open;
  for (size_t at = 0, end = 0; (at = markup.find('<', end)) != std::string::npos;) {
    const std::string near = markup.substr(at, 60);
    end = end_of_tag(markup, at);
    ASSERT_NE(end, std::string::npos) << "open tag: " << near;
    const std::string tag = markup.substr(at + 1, end - at - 2);
    if (tag == "!DOCTYPE html") continue;
    ASSERT_EQ(tag.find('<'), std::string::npos) << "stray < in: " << near;
    const bool closes = tag[0] == '/';
    ASSERT_TRUE(std::isalpha(static_cast<unsigned char>(tag[closes]))) << "stray <: " << near;
    const std::string name = tag.substr(closes, tag.find_first_of(" /", closes) - closes);
    if (closes) {
      ASSERT_FALSE(open.empty()) << near;
      ASSERT_EQ(open.back(), name) << near;
      open.pop_back();
    } else if (!empty.count(name) && tag.back() != '/') {
      open.push_back(name);
    }
  }
  EXPECT_TRUE(open.empty()) << open.back();
}

// Expects that nothing is loaded from elsewhere.
inline void expect_self_contained(const std::string& page) {
  for (const char* word : {"http://", "https://", "<link", "@import", "url(", "<iframe"})
    EXPECT_EQ(page.find(word), std::string::npos) << word;
  for (const std::string source : {"src=\"", "href=\""})
    for (size_t at = 0; (at = page.find(source, at)) != std::string::npos; at += source.size())
      EXPECT_EQ(page.substr(at + source.size(), 11), "data:image/");
}

}  // namespace gflow
