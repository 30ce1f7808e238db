// SPDX-License-Identifier: Apache-2.0
// Pieces of HTML for reports: text that is safe in a page, tables, and the page around them.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace gflow::report {

// Text for an element or a quoted attribute: & < > " ' become character references, bytes that are
// not UTF-8 and control characters become \x1b and the like.
std::string escaped(const std::string& text);

// A number with `digits` decimal places; a dash if it is not finite.
std::string number(double value, int digits);
// A whole number in groups of three: 91 137.
std::string grouped(double value);
// "44 s", "3.7 min", "2.1 h".
std::string duration(double seconds);
// "1 image", "20 images".
std::string counted(size_t count, std::string_view one, std::string_view several);
// Today in UTC, "2026-01-31".
std::string today();

// A cell of a table; its text is HTML.
struct TableCell {
  std::string html;
  bool strong = false, is_text = false;  // is_text: aligned left, numbers are aligned right
};
// A table with a caption for screen readers. head: HTML, one text per column. The first cell of
// each row is its heading.
std::string table(const std::string& caption, const std::vector<TableCell>& head,
                  const std::vector<std::vector<TableCell>>& rows);

// The line above a title: what the page is (plain text), and its date.
std::string brand(const std::string& what, const std::string& date);

// A section with a heading, and a sentence below it unless `about` is empty. All are HTML.
std::string section(const std::string& heading, const std::string& about, const std::string& body);

// The whole document: title (plain text), contents (HTML), with style and script inside it. It
// needs no other file.
std::string page(const std::string& title, const std::string& contents);

}  // namespace gflow::report
