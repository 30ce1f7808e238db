"""The environment of the program: clock, locale, folder names, drivers, the cache of compiled kernels."""
import errno
import os
import random
import shutil
import signal
import struct
import subprocess

from outputs import write_plan
from world import complaints, content, ended, failed_calls, settings


def as_always(world, name, env, run=None):
    """A training that must equal the undisturbed one, also when resumed from its middle."""
    run = run or world.path("surrounded")
    shutil.rmtree(run, ignore_errors=True)
    outcome = world.train(run, env)
    wrong = complaints(outcome, (0,)) + ([f"it said {outcome.err.strip()!r}"] if outcome.err else [])
    wrong += world.differences(run)
    shutil.rmtree(run)
    shutil.copytree(world.stopped, run)
    outcome = world.resume(run, env)
    wrong += complaints(outcome, (0,)) + ([f"resumed it said {outcome.err.strip()!r}"] if outcome.err else [])
    wrong += world.differences(run)
    shutil.rmtree(run)
    return [f"{name}: {what}" for what in wrong]


def clock(world):
    report = world.path("clock.report")
    results = []
    for i in range(3):
        wrong = as_always(world, f"trial {i + 1}", {"LD_PRELOAD": world.shims["clock_jumps"], "CLOCK_REPORT": report})
        jumped = os.path.exists(report)
        results.append(wrong + ([] if jumped else [f"trial {i + 1}: nobody asked for the time, which did not jump"]))
        if jumped:
            os.remove(report)
    return results


def locales(world):
    """Locales with a decimal comma and without UTF-8; prints if they cannot be created."""
    folder = world.path("locales")
    os.makedirs(folder)
    results = []
    for language, coding in (("de_DE", "UTF-8"), ("fr_FR", "ISO-8859-1"), ("tr_TR", "UTF-8")):
        name = f"{language}.{coding}"
        made = shutil.which("localedef") and subprocess.run(
            ["localedef", "-i", language, "-f", coding, os.path.join(folder, name)], capture_output=True).returncode <= 1
        if not made or not os.path.isdir(os.path.join(folder, name)):
            print(f"    left out: {name} cannot be made here; install the package locales")
            continue
        results.append(as_always(world, name, {"LOCPATH": folder, "LC_ALL": name, "LANG": name}))
    return results


def odd_paths(world):
    results = []
    names = ["with space", "two\nlines", "ünïcode 画像 🎬", "quote's \"and\" $(so) `on` \\", "-o", "%s %n {0}",
             os.fsdecode(b"not \xff utf-8"), "x" * 200]
    for name in names:
        parent = world.path("odd")
        shutil.rmtree(parent, ignore_errors=True)
        os.makedirs(parent)
        scene, run = os.path.join(parent, name + " scene"), os.path.join(parent, name)
        os.symlink(world.scene, scene)
        outcome = world.run(["train", scene, "-o", run, *settings()])
        wrong = complaints(outcome, (0,))
        left, expected = world.left_in(run), dict(world.expected)
        for file in ("config.toml",):  # contains the scene's path
            left.pop(file), expected.pop(file)
        wrong += [f"{file} is not as in a plain folder" for file in left if left[file] != expected[file]]
        resume = ["-o", run, "--resume", "--quiet"]
        wrong += complaints(world.run(["train", *resume]), (0,))
        for command in (["info", run], ["train", scene, *resume],
                        ["export", run, "-o", os.path.join(parent, name + ".ply"), "--quiet"],
                        ["render", run, "-o", os.path.join(parent, name + " images"), "--quiet"]):
            wrong += complaints(world.run(command), (0,))
        results.append([f"{name!r}: {what}" for what in wrong])
    loop, link = world.path("loop"), world.path("link")
    os.symlink(loop, loop)
    for arguments in (["train", loop, "-o", world.path("none"), *settings()],
                      ["train", world.scene, "-o", loop, *settings()], ["info", loop],
                      ["export", world.whole, "-o", loop + "/a.ply", "--quiet"]):
        wrong = complaints(world.run(arguments), (1,), [loop])
        results.append([f"a link to itself, {arguments[0]}: {what}" for what in wrong])
    os.symlink(world.path("behind the link"), link)
    os.makedirs(world.path("behind the link"))
    wrong = complaints(world.train(link), (0,)) + world.differences(link)
    results.append([f"a link to a folder: {what}" for what in wrong])
    return results


def no_driver(world):
    results = []
    plan = world.path("no-driver.toml")
    write_plan(world, plan)
    for arguments in (["train", world.scene, "-o", world.path("none"), *settings()],
                      ["train", "-o", world.stopped, "--resume"], ["devices"], ["bench", "raster"], ["stress", "--quick"],
                      ["render", world.whole, "-o", world.path("none"), "--quiet"], ["eval", world.whole],
                      ["experiment", plan, "-o", world.path("none"), "--quiet"]):
        outcome = world.run(arguments, {"OCL_ICD_VENDORS": world.path("no drivers")})
        wrong = complaints(outcome, (2,), ["no OpenCL device found: install"])
        if os.path.exists(world.path("none")):
            wrong.append("something was written")
        results.append([f"{arguments[0]}: {what}" for what in wrong])
    return results


def no_environment(world):
    """An environment as of a service: no variable except the folder of compiled kernels, which is empty."""
    cache = world.path("no-environment")
    done = subprocess.run([world.gflow, "devices"], env={"POCL_CACHE_DIR": cache}, capture_output=True, text=True)
    return [[] if done.returncode == 0 and "   usable\n" in done.stdout else
            [f"exit code {done.returncode}: {done.stdout}{done.stderr}"]]


def damaged_caches(world):
    """Whatever the cache of compiled kernels contains or its folder is, results are the same, without a message."""
    good, cache = world.path("cache good"), world.path("cache")
    random.seed(3)
    results = [as_always(world, "empty", {"GFLOW_CACHE_DIR": good})]
    files = sorted(os.listdir(good))
    if not files:
        return [["no program was kept"]]
    results.append(as_always(world, "kept", {"GFLOW_CACHE_DIR": good}))

    def flipped(data):
        data = bytearray(data)
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        return bytes(data)

    damages = {f"a bit flipped, {i + 1}": flipped for i in range(4)}
    damages.update({"in the header": lambda data: data[:9] + flipped(data[9:24]) + data[24:],
                    "cut in half": lambda data: data[:len(data) // 2], "a byte short": lambda data: data[:-1],
                    "nothing in it": lambda data: b"", "only a header": lambda data: data[:24],
                    "longer": lambda data: data + b"more", "of another kind": lambda data: b"\x7fELF" + data})
    for name, damage in damages.items():
        shutil.rmtree(cache, ignore_errors=True)
        shutil.copytree(good, cache)
        for file in files:
            data = content(os.path.join(good, file))
            with open(os.path.join(cache, file), "wb") as out:
                out.write(damage(data))
        wrong = as_always(world, name, {"GFLOW_CACHE_DIR": cache})
        wrong += [f"{name}: {file} was not written again" for file in files
                  if content(os.path.join(cache, file)) != content(os.path.join(good, file))]
        results.append(wrong)
    results.append(well_sealed(world, cache, good, files))
    shutil.rmtree(cache)
    os.makedirs(cache)
    for i, file in enumerate(files):  # each under another's name
        shutil.copy(os.path.join(good, file), os.path.join(cache, files[i - 1]))
    results.append(as_always(world, "names exchanged", {"GFLOW_CACHE_DIR": cache}))
    for name in ("files that are folders",):
        shutil.rmtree(cache)
        for file in files:
            os.makedirs(os.path.join(cache, file))
        results.append(as_always(world, name, {"GFLOW_CACHE_DIR": cache}))
    results.append(as_always(world, "below a file", {"GFLOW_CACHE_DIR": os.path.join(good, files[0], "cache")}))
    shutil.rmtree(cache)
    results.append(two_writers(world, cache, good, files))
    for first, last, why, code in ((1, 10**9, "read-only", 30), (9, 10**9, "disk full", 28), (4, 4, "an error", 5)):
        shutil.rmtree(cache, ignore_errors=True)
        os.makedirs(cache)
        wrong = as_always(world, why, {
            "GFLOW_CACHE_DIR": cache, "LD_PRELOAD": world.shims["fail_io"], "FAULT_FOLDER": cache, "FAULT_CALL": str(first),
            "FAULT_LAST": str(last), "FAULT_ERRNO": str(code), "FAULT_REPORT": world.path("cache.report")})
        wrong += [f"{why}: {file} was left behind" for file in os.listdir(cache) if file.endswith(".tmp")]
        results.append(wrong)
    return results


def sealed(name, payload):
    """A cache file as gflow writes it (runtime/cl/program_cache.cpp): the checksum starts with the name."""
    checksum = int(name[:16], 16)
    for byte in payload:
        checksum = (checksum ^ byte) * 1099511628211 % (1 << 64)
    return b"GFLOWBI2" + struct.pack("<QQ", len(payload), checksum) + payload


def well_sealed(world, cache, good, files):
    """Valid cache files whose contents are not a program: the driver receives and rejects them."""
    shutil.rmtree(cache)
    os.makedirs(cache)
    smallest = min(files, key=lambda file: os.path.getsize(os.path.join(good, file)))
    data = content(os.path.join(good, smallest))
    if sealed(smallest, data[24:]) != data:
        return ["well sealed nonsense: gflow seals otherwise, so that it would not be taken for whole"]
    for file in files:
        with open(os.path.join(cache, file), "wb") as out:
            out.write(sealed(file, b"no program at all"))
    wrong = as_always(world, "well sealed nonsense", {"GFLOW_CACHE_DIR": cache})
    return wrong + [f"well sealed nonsense: {file} was not written again" for file in files
                    if content(os.path.join(cache, file)) != content(os.path.join(good, file))]


def two_writers(world, cache, good, files):
    runs = [world.path(f"writer {i}") for i in range(2)]
    both = [world.start(["train", world.scene, "-o", run, *settings()], {"GFLOW_CACHE_DIR": cache}) for run in runs]
    wrong = []
    for process, run in zip(both, runs):
        outcome = ended(process)
        wrong += complaints(outcome, (0,)) + ([f"it said {outcome.err!r}"] if outcome.err else [])
        wrong += world.differences(run)
    if sorted(os.listdir(cache)) != files:
        wrong.append(f"there are {sorted(os.listdir(cache))}")
    wrong += [f"{file} differs" for file in files
              if content(os.path.join(cache, file)) != content(os.path.join(good, file))]
    return [f"two writers: {what}" for what in wrong]


def full_folder_of_pocl(world):
    """PoCL's folder is full, or the user's quota is used up, from some call on: gflow reports more than LLVM's
    message, which does not name the folder, or that PoCL has no device."""
    cache, report = world.path("programs of pocl"), world.path("pocl.report")

    def ended_with(first, code):
        shutil.rmtree(cache, ignore_errors=True)
        os.makedirs(cache)
        open(report, "w").close()
        return world.run(["stress", "--only", "T5", "--quiet"], {
            "POCL_CACHE_DIR": cache, "LD_PRELOAD": world.shims["fail_io"], "FAULT_FOLDER": cache, "FAULT_CALL": str(first),
            "FAULT_LAST": str(10**9), "FAULT_ERRNO": str(code), "FAULT_REPORT": report})

    outcome = ended_with(0, 0)
    numbers = [number for number, _ in failed_calls(report)[1]]
    if outcome.code != 0 or len(numbers) < 100:
        return [[f"without a fault: {outcome.last_line()}, {len(numbers)} calls"]]
    results, stopped = [], 0
    for i in range(12):
        first, code = 1 + i * i * max(numbers) // 144, (errno.ENOSPC, errno.EDQUOT)[i % 2]
        outcome = ended_with(first, code)
        stopped += outcome.code != 0
        outcome.err = "".join(line for line in outcome.err.splitlines(True) if line.startswith("gflow: "))
        wrong = complaints(outcome, (0, 1, 2), [cache, os.strerror(code)])
        results.append([f"{os.strerror(code)} from call {first} on: {what}" for what in wrong])
    return results + [[] if stopped >= 6 else [f"only {stopped} of {len(results)} were stopped by it"]]


def no_threads(world):
    """No thread can be created from the k-th on: fewer do the same work, or an error reports it. PoCL aborts if it
    gets none, which gflow cannot prevent."""
    results, run, report = [], world.path("few threads"), world.path("threads.report")
    for k in range(1, 41):
        shutil.rmtree(run, ignore_errors=True)
        open(report, "w").close()
        outcome = world.train(run, {"LD_PRELOAD": world.shims["fail_thread"], "FAULT_THREAD": str(k),
                                    "FAULT_REPORT": report})
        if not content(report):
            return results if k > 3 else results + [[f"only {k - 1} threads are started"]]
        if outcome.code == -signal.SIGABRT and "PTHREAD ERROR" in outcome.err:
            results.append([])
            continue
        wrong = complaints(outcome, (0, 1), ["threads"])
        wrong += world.differences(run) if outcome.code == 0 else []
        results.append([f"no thread from number {k} on: {what}" for what in wrong])
    return results


def faults(world, every):
    yield "surroundings: the clock jumps", lambda: clock(world)
    yield "surroundings: locales with a decimal comma", lambda: locales(world)
    yield "surroundings: odd paths and links", lambda: odd_paths(world)
    yield "surroundings: no OpenCL driver", lambda: no_driver(world)
    yield "surroundings: no environment", lambda: no_environment(world)
    yield "surroundings: damaged caches of kernels", lambda: damaged_caches(world)
    yield "surroundings: no more threads", lambda: no_threads(world)
    yield "surroundings: no room where PoCL compiles", lambda: full_folder_of_pocl(world)
