"""Recompiles and relinks parts of a build with a changed file, by the commands of that build (ninja)."""
import json
import os
import re
import shlex
import subprocess
import sys

# Besides the test program, these compile kernels/shared as reference for the device.
HOST_SIDE = {"gflow_runtime", "gflow_stress"}


def target_of(output):
    return re.search(r"([^/]+)\.dir/", output)[1]


class Build:
    def __init__(self, folder):
        self.folder = os.path.abspath(folder)
        cache = os.path.join(self.folder, "CMakeCache.txt")
        if not os.path.isfile(cache):
            sys.exit(f"tests/mutations/run: {folder} is not a build: tests/run makes one")
        self.root = re.search(r"CMAKE_HOME_DIRECTORY:\w+=(.*)", open(cache, encoding="utf-8").read())[1]
        self.units = [unit for unit in json.loads(self.ninja("compdb"))
                      if unit["output"].endswith(".o") and unit["file"].endswith((".cpp", ".cxx"))]
        for unit in self.units:
            path = os.path.join(self.folder, unit["file"])
            unit["text"] = open(path, encoding="utf-8").read() if "/Unity/" in path else f'#include "{path}"\n'

    def ninja(self, *tool):
        words = ["ninja", "-n", "-C", self.folder, "-t", *tool]
        return subprocess.check_output(words, text=True, stderr=subprocess.DEVNULL)

    def path(self, program):
        return os.path.join(self.folder, "" if program == "gflow" else "tests", program)

    def has(self, program):
        return os.access(self.path(program), os.X_OK)

    def runs_gflow(self, program):
        return any(target_of(unit["output"]) == program and "-DGFLOW_BINARY=" in unit["command"] for unit in self.units)

    def units_of(self, file, program):
        """What to recompile when the file changes; for a header, the library of its folder and the test program."""
        path = os.path.join(self.root, file)
        if file.endswith(".cpp"):
            return [unit for unit in self.units if f'"{path}"' in unit["text"]]
        if file.endswith(".cl"):
            return []
        beside = re.compile(re.escape(f'"{os.path.dirname(path)}/') + r'[^/"]*"')
        targets = {target_of(unit["output"]) for unit in self.units if beside.search(unit["text"])} | {program}
        if file.startswith("kernels/"):
            targets |= HOST_SIDE
        return [unit for unit in self.units if target_of(unit["output"]) in targets
                and path in self.ninja("deps", unit["output"]).split()]

    def compile(self, unit, file, scratch, result):
        """Whether it compiles with the file's copy in scratch in place of the original."""
        source = result + ".cpp"
        with open(source, "w", encoding="utf-8") as out:
            out.write(unit["text"].replace(f'"{self.root}/{file}"', f'"{scratch}/{file}"'))
        words = [word for word in shlex.split(unit["command"]) if word not in ("-Werror", "-Winvalid-pch")]
        for option, count in (("-MD", 1), ("-MT", 2), ("-MF", 2)):
            at = words.index(option)
            del words[at : at + count]
        words[words.index("-o") + 1] = result
        words[words.index("-c") + 1] = source
        words[1:1] = ["-w", "-I", scratch, "-I", f"{scratch}/kernels"]
        return subprocess.run(words, cwd=self.folder, capture_output=True).returncode == 0

    def link(self, program, objects, result):
        """The program linked with these objects ({replaced object: path}); "" if it contains none of them."""
        name = program if program == "gflow" else "tests/" + program
        words = [word for word in shlex.split(self.ninja("commands", name).splitlines()[-1]) if word not in (":", "&&")]
        libraries = {os.path.basename(word) for word in words if word.endswith(".a")}
        used = [output for output in objects if output in words or f"lib{target_of(output)}.a" in libraries]
        if not used:
            return ""
        for output in used:
            if output in words:
                words[words.index(output)] = objects[output]
            else:
                words.insert(words.index("-o"), objects[output])  # before the library with the original
        words[words.index("-o") + 1] = result
        subprocess.run(words, cwd=self.folder, check=True, capture_output=True)
        return result
