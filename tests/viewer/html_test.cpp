// SPDX-License-Identifier: Apache-2.0
// The page as one file.
#include "apps/viewer/html.hpp"

#include <zlib.h>

#include "apps/viewer/page_files.hpp"
#include "runtime/base/base64.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/viewer/container.hpp"

namespace gflow {
namespace {

using Files = std::map<std::string, std::string>;

TEST(Gzipped, IsReadByZlib) {
  std::string bytes;
  for (int i = 0; i < 100000; ++i) bytes += char(i * i >> 7);
  for (const std::string& given : {std::string(), bytes}) {
    const std::string packed = gzipped(given);
    std::string back(given.size() + 1, '\0');
    z_stream stream{};
    ASSERT_EQ(inflateInit2(&stream, MAX_WBITS + 16), Z_OK);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = uInt(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(back.data());
    stream.avail_out = uInt(back.size());
    EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
    back.resize(stream.total_out);
    inflateEnd(&stream);
    EXPECT_EQ(back, given);
  }
}

TEST(Bundled, PutsModulesBeforeThoseThatImportThem) {
  const Files files = {
      {"main.js", "import { f, G } from './a.js';\nimport { x,\n  y } from './b-c.js';\nf(x);\n"},
      {"a.js",
       "import { x } from './b-c.js';\nexport function f(z) { return x; }\nexport class G {\n}\n"},
      {"b-c.js", "const hidden = 1;\nexport const x = hidden;\nexport async function y() {}\n"}};
  EXPECT_EQ(
      bundled(files, "main.js"),
      "const $b_c_js = (() => {\nconst hidden = 1;\nconst x = hidden;\nasync function y() {}\n"
      "return { x, y };\n})();\n"
      "const $a_js = (() => {\nconst { x } = $b_c_js;\n\nfunction f(z) { return x; }\nclass G "
      "{\n}\n"
      "return { f, G };\n})();\n"
      "const { f, G } = $a_js;\nconst { x,  y } = $b_c_js;\n\n\nf(x);\n");
}

TEST(Bundled, RefusesWhatItCannotPutIntoOneFile) {
  const auto refuse = [](const Files& files, const std::string& part) {
    expect_error([&] { bundled(files, "main.js"); }, {part});
  };
  refuse({{"main.js", "import * as a from './a.js';\n"}}, "import * as a");
  refuse({{"main.js", "export default 3;\n"}}, "export default");
  refuse({{"main.js", "export { a };\n"}}, "export { a }");
  refuse({{"main.js", "import { a } from './a.js';\n"}}, "lacks a.js");
  refuse(
      {{"main.js", "import { a } from './a.js';\n"}, {"a.js", "import { b } from './main.js';\n"}},
      "imports itself");
}

// The page as it is embedded in the program.
TEST(PageWithModel, NeedsNothingFromOutside) {
  const std::string page = page_with_model(page_files(), "model", {{"name", "</script><b>"}});
  EXPECT_EQ(page.find(" src="), std::string::npos);
  EXPECT_EQ(page.find("rel=\"stylesheet\""), std::string::npos);
  EXPECT_EQ(page.find("</script><b>"), std::string::npos);
  EXPECT_NE(page.find("id=\"gflow-model\" data-encoding=\"gzip\">" + base64(gzipped("model")) +
                      "</script>"),
            std::string::npos);
  EXPECT_LT(page.size(), 100'000u);
}

}  // namespace
}  // namespace gflow
