// SPDX-License-Identifier: Apache-2.0
// The protocol with several programs: shells that follow or violate it, and Python.
#include "optim/guidance/process.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <thread>

#include "apps/stress/training/request.hpp"
#include "tests/support/python.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

using Clock = std::chrono::steady_clock;

// A shell program that greets and then answers each request with one line.
std::string answering(const std::string& line) {
  return "read hello; echo '{\"version\": 1}'; while read request; do echo '" + line + "'; done";
}

// Whether the process ends within two seconds. It is not a child of the test, so another process
// reaps it.
bool comes_to_an_end(int process) {
  for (int i = 0; i < 2000; ++i) {
    std::ifstream stat("/proc/" + std::to_string(process) + "/stat");
    std::string id, command, state;
    if (!(stat >> id >> command >> state) || state == "Z") return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

void expect_failure(const std::string& command, std::initializer_list<std::string> parts,
                    double time_out = 5, bool flow = false) {
  expect_error(
      [&] {
        ProcessGuidance guidance(command, time_out, {});
        const GuidanceRequest request = some_request(1, 4, 3, flow);
        require_usable(request, guidance.guide(request), guidance.name());
      },
      parts);
}

TEST(Process, AShellScriptMayAnswer) {
  ProcessGuidance guidance(
      answering("{\"views\": [{\"gradient\": [3, 3, 4], \"weight\": 0.5}, {\"gradient\": null}]}"),
      5, {});
  for (int i = 0; i < 3; ++i) {
    const auto answers = guidance.guide(some_request(2, 4, 3));
    ASSERT_EQ(answers.size(), 2u);
    EXPECT_EQ(answers[0].weight, 0.5f);
    EXPECT_EQ(answers[0].gradient, std::vector<float>(36, 0.f));  // the program wrote nothing there
    EXPECT_TRUE(answers[1].gradient.empty());
  }
}

TEST(Process, AProgramThatDoesNotStartOrDiesIsNamedWithItsEnd) {
  expect_failure("no-such-program",
                 {"`no-such-program`", "exited with code 127", "command not found"});
  expect_failure("exit 3", {"`exit 3`", "exited with code 3"});
  expect_failure("read hello; echo '{\"version\": 1}'; read request; exit 4",
                 {"exited with code 4"});
  expect_failure("read hello; echo '{\"version\": 1}'; kill -SEGV $$", {"signal 11"});
}

TEST(Process, AProgramMaySayWhyItGivesUpBeforeItIsSpokenTo) {
  expect_failure("echo '{\"error\": \"no weights here\"}'", {"reported an error: no weights here"});
}

TEST(Process, ASilentProgramIsGivenUpInTime) {
  const auto start = Clock::now();
  expect_failure("sleep 60", {"has not answered for 0.2 s (guidance.timeout)"}, 0.2);
  expect_failure("read hello; echo '{\"version\": 1}'; sleep 60", {"has not answered for 0.2 s"},
                 0.2);
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(30));
}

TEST(Process, GarbageIsShown) {
  expect_failure("echo hello world; cat", {"hello world", "not a JSON object", "standard error"});
  expect_failure("echo '[1]'; cat", {"[1]"});
  expect_failure("head -c 3000000 /dev/zero; cat", {"without a line break"});
  expect_failure("echo '{\"version\": 2}'; cat", {"{\"version\":2}", "{\"version\": 1}"});
  expect_failure("echo '{}'; cat", {"{\"version\": 1}"});
  expect_failure(answering("{}"), {"without a list of 1 views"});
  expect_failure(answering("{\"views\": [1]}"), {"1 for view 0", "object"});
  expect_failure(answering("{\"views\": [{}, {}]}"), {"without a list of 1 views"});
}

TEST(Process, WrongSizesAndWeightsAreRefused) {
  expect_failure(answering("{\"views\": [{\"gradient\": [3, 4, 3]}]}"),
                 {"gradient of shape [3,4,3]", "[3,3,4]"});
  expect_failure(answering("{\"views\": [{\"flow\": [2, 3, 5]}]}"),
                 {"flow of shape [2,3,5]", "[2,3,4]"}, 5, true);
  expect_failure(answering("{\"views\": [{\"gradient\": true}]}"), {"shape true"});
  expect_failure(answering("{\"views\": [{\"flow\": [2, 3, 4]}]}"),
                 {"a flow that was not requested"});
  expect_failure(answering("{\"views\": [{\"weight\": \"much\"}]}"),
                 {"\"much\"", "expected a number"});
  expect_failure(answering("{\"views\": [{\"weight\": -1}]}"), {"-1", "at least 0"});
}

TEST(Process, ItsOwnErrorIsPassedOn) {
  expect_failure(answering("{\"error\": \"out of memory\"}"), {"reported an error: out of memory"});
  expect_failure(answering("{\"error\": \"\"}"), {"reported an error without a message"});
  expect_failure(answering("{\"error\": \"" + std::string(600, 'x') + "\"}"),
                 {"reported an error: " + std::string(500, 'x') + "..."});
}

// Its child processes end with it, even if they ignore the end of their input.
TEST(Process, IsEndedWithAllItStarted) {
  const TemporaryFolder folder;
  const std::string pids = folder.file("pids");
  {
    ProcessGuidance guidance("trap '' TERM; sleep 600 & echo $$ $! > " + pids +
                                 "; read hello; echo '{\"version\": 1}'; wait",
                             5, {});
  }
  std::ifstream file(pids);
  int shell = 0, sleeping = 0;
  ASSERT_TRUE(file >> shell >> sleeping);
  EXPECT_NE(kill(shell, 0), 0);
  EXPECT_TRUE(comes_to_an_end(sleeping));
}

// The program has ended, but a child of it keeps its output open.
TEST(Process, IsEndedWithWhatItLeftBehind) {
  const TemporaryFolder folder;
  const std::string file = folder.file("pid");
  const auto start = Clock::now();
  expect_failure("sleep 600 & echo $! > " + file + "; read hello; echo '{\"version\": 1}'; exit 0",
                 {"exited with code 0"}, 60);
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(30));
  int sleeping = 0;
  ASSERT_TRUE(std::ifstream(file) >> sleeping);
  EXPECT_TRUE(comes_to_an_end(sleeping));
}

// The request contains the name of the shared memory.
TEST(Process, MayNotCutTheMemoryItShares) {
  const std::string cut =
      "read hello; echo '{\"version\": 1}'; while read request; do "
      "name=${request#*gflow-guidance}; "
      "truncate -s 0 /dev/shm/gflow-guidance${name%%\\\"*}; echo '{\"views\": [{\"gradient\": "
      "[3, 3, 4]}]}'; done";
  if (!std::filesystem::exists("/dev/shm")) GTEST_SKIP() << "no /dev/shm to look into";
  expect_failure(cut, {"truncated the shared memory to 0 of", "must not resize it"});
}

TEST(Process, LeavesNoSharedMemoryBehind) {
  const auto count = [] {
    size_t n = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm"))
      n += entry.path().filename().string().rfind(
               "gflow-guidance-" + std::to_string(getpid()) + "-", 0) == 0;
    return n;
  };
  if (!std::filesystem::exists("/dev/shm")) GTEST_SKIP() << "no /dev/shm to look into";
  ProcessGuidance guidance(answering("{\"views\": [{}]}"), 5, {});
  guidance.guide(some_request(1, 4, 3));
  EXPECT_EQ(count(), 0u);  // as if the test were killed now
}

// Every field of the request and of the answer is transferred.
TEST(Process, PythonSeesTheRequestAndAnswers) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  const TemporaryFolder folder;
  const std::string program = folder.write("provider.py", R"(
from gflow_guidance import Answer, serve
import numpy as np
print("loading")  # not an answer
def guide(r):
    answers = []
    for i, v in enumerate(r.views):
        assert v.camera.name == f"eval_{i}" and v.rgb.shape == (3, v.camera.height, v.camera.width)
        assert v.camera.K[0, 0] == 1.5 * v.camera.width and v.camera.viewmat[2, 3] == 3
        assert abs(v.azimuth - 30 - i) < 1e-9 and v.elevation == -10 and v.distance == 0.5
        assert 0.02 <= v.timestep <= 0.74 and r.background.tolist() == [1, 1, 1]
        assert (r.step, r.steps, r.frame, r.time, r.seed) == (7, 20, 2, 0.5, 11)
        assert (r.next_time is None) == (v.flow is None)
        answer = Answer(gradient=v.rgb - r.reference.rgb, weight=2)
        if v.flow is not None:
            answer.flow = 3 * v.flow
            answer.confidence = np.arange(v.flow[0].size).reshape(v.flow[0].shape) % 2 == 0
        answers.append(answer)
    return answers
serve(guide)
)");
  ProcessGuidance guidance(python() + program, 60, {});
  for (const bool flow : {false, true, false}) {
    const GuidanceRequest request = some_request(flow ? 3 : 1, 5, 4, flow);
    const auto answers = guidance.guide(request);
    require_usable(request, answers, guidance.name());
    for (size_t v = 0; v < answers.size(); ++v) {
      EXPECT_EQ(answers[v].weight, 2);
      for (size_t i = 0; i < 60; ++i)
        EXPECT_EQ(answers[v].gradient[i], request.views[v].rgb[i] - request.reference.rgb[i]);
      ASSERT_EQ(answers[v].flow.size(), flow ? 40u : 0u);
      for (size_t i = 0; i < answers[v].flow.size(); ++i)
        EXPECT_EQ(answers[v].flow[i], 3 * request.views[v].flow[i]);
      for (size_t i = 0; i < answers[v].confidence.size(); ++i)
        EXPECT_EQ(answers[v].confidence[i], i % 2 == 0 ? 255 : 0);
    }
  }
}

TEST(Process, PythonTellsWhatWentWrong) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  const TemporaryFolder folder;
  const std::string program = folder.write("provider.py", R"(
from gflow_guidance import Answer, serve
import sys
sys.stderr = open("/dev/null", "w")
def guide(r):
    if r.views[0].camera.width == 5:
        return [Answer(gradient=r.views[0].rgb[:, 1:])]
    if r.views[0].camera.width == 6:
        return [Answer(gradient=v.rgb, weight=float("nan")) for v in r.views]
    if r.views[0].camera.width == 7:
        return [Answer()]
    raise ValueError("the object is gone")
serve(guide)
)");
  const auto expect = [&](const GuidanceRequest& request,
                          std::initializer_list<std::string> words) {
    ProcessGuidance guidance(python() + program, 60, {});  // the program ends with an error
    expect_error([&] { guidance.guide(request); }, words);
  };
  expect(some_request(1, 5, 4), {"[3,3,5]", "[3,4,5]"});
  expect(some_request(1, 6, 4), {"the weight of an answer is nan; it must be finite"});
  expect(some_request(2, 7, 4), {"1 answers for 2 views"});
  expect(some_request(1, 4, 4), {"ValueError: the object is gone"});
}

TEST(Process, TheExamplesRefuseWhatTheyCannotUse) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  const std::string folder = GFLOW_SOURCE_DIR "/apps/guidance/";
  expect_failure(python() + folder + "example_target.py", {"a folder of images"}, 60);
  expect_failure(python() + folder + "example_target.py no/such/folder",
                 {"there is no folder no/such/folder"}, 60);
  // Either the packages or the weights are missing.
  expect_failure(python() + folder + "example_zero123.py no/such/weights", {"reported an error"},
                 60);
}

}  // namespace
}  // namespace gflow
