"""Runs test programs in a sandbox and reports their results."""
import os
import re
import subprocess
import sys
import time

STRESS = "gflow stress --quick"

# $1: scratch folder; $2: a program in place of $3, or empty; then the command. File systems are read-only except the
# scratch folder, whose tmp is /tmp; separate process ids, half of the memory.
SCRIPT = r"""
ulimit -c 0; ulimit -Sd $MEMORY_KB; ulimit -Sf 16000000
scratch=$1; changed=$2; original=$3; shift 3
mount --bind "$scratch" "$scratch" && mount --bind "$scratch/tmp" /tmp || exit 125
[ -z "$changed" ] || mount --bind "$changed" "$original" || exit 125
while read -r _ at _; do
  case $at in "$scratch"|/tmp|/proc*|/sys*|/dev*) ;; *) mount -o remount,bind,ro "$at" 2>/dev/null ;; esac
done </proc/mounts
mount -t proc proc /proc && [ ! -w "$PWD" ] || exit 125
"$@"
exit $?  # not exec: the first process of a namespace ignores signals
"""


class Tests:
    def __init__(self, build, scratch, filter):
        self.build, self.scratch, self.filter, self.known = build, scratch, filter, {}
        self.environment = {**os.environ, "TMPDIR": "/tmp", "MEMORY_KB": str(os.sysconf("SC_PHYS_PAGES") * 2),
                            "GFLOW_CACHE_DIR": f"{scratch}/cache", "POCL_CACHE_DIR": f"{scratch}/pocl"}
        self.environment.pop("GTEST_OUTPUT", None)
        for folder in ("tmp", "cache", "pocl"):
            os.mkdir(os.path.join(scratch, folder))
        self.confined(["true"], 60, {})

    def confined(self, command, limit, environment, gflow=""):
        """Exit code and output; the code is None after a timeout."""
        words = ["unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork", "--kill-child",
                 "sh", "-c", SCRIPT, "sh", self.scratch, gflow, self.build.path("gflow"), *command]
        try:
            done = subprocess.run(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  text=True, errors="replace", timeout=limit, cwd=self.build.root,
                                  env={**self.environment, **environment})
        except subprocess.TimeoutExpired:
            return None, ""
        if done.returncode == 125 or (command == ["true"] and done.returncode != 0):
            sys.exit(f"tests/mutations/run: cannot confine tests (unshare, user namespaces): {done.stdout}")
        return done.returncode, done.stdout

    def run(self, program, chosen, environment, limit, path="", gflow="", options=()):
        """path, gflow: run in place of the build's."""
        path = path or self.build.path(program.split()[0])
        words = [*program.split()[1:], "--quiet"] if program == STRESS else [f"--gtest_filter={chosen}", *options]
        return self.confined([path, *words], limit, environment, gflow)

    def unchanged(self, program, environment):
        """Time limit in seconds and the tests that fail without a mutant, which are left out."""
        key = program, *environment
        if key not in self.known:
            start = time.time()
            code, output = self.run(program, self.filter, environment, 7200)
            failing = sorted(set(re.findall(r"(?m)^\[  FAILED  \] ([\w/]+\.[\w/]+)", output)))
            if code != 0 and not (code == 1 and failing):
                sys.exit(f"tests/mutations/run: {program} fails without a mutant (exit code {code}):\n{output[-2000:]}")
            seconds = time.time() - start
            print(f"# {program}: {seconds:.0f} s without a mutant" +
                  ("; left out, as they fail confined: " + ", ".join(failing) if failing else ""), flush=True)
            self.known[key] = 60 + 3 * seconds, failing
        return self.known[key]

    def verdict(self, program, chosen, environment, limit, failing, path, gflow):
        chosen += "-" + ":".join(failing) if failing else ""
        code, output = self.run(program, chosen, environment, limit, path, gflow, ["--gtest_fail_fast"])
        if "CL_BUILD_PROGRAM_FAILURE" in output:
            return "uncompiled"
        return "survived" if code == 0 else "caught"

    def failing(self, program, environment, limit, done):
        """The filter of the tests that fail now; empty if all pass. After a crash it goes on with the tests left."""
        failed, done = set(), set(done)
        while True:
            code, output = self.run(program, f"{self.filter}-{':'.join(sorted(failed | done))}", environment, limit)
            if program == STRESS or code is None:
                return "" if code == 0 else self.filter
            began = set(re.findall(r"(?m)^\[ RUN      \] (\S+)", output))
            passed = set(re.findall(r"(?m)^\[       OK \] (\S+)|^\[  SKIPPED \] (\S+)", output))
            passed = {name for names in passed for name in names if name}
            failed, done = failed | (began - passed), done | passed
            if code in (0, 1) or not began:
                return ":".join(sorted(failed))
