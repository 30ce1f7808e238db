"""Device faults: failing allocations, copies, launches and builds; lost, hanging and small devices. Fails each
allocation, build and wait. Of kernel creations, arguments, launches and copies it fails the first ones and as many
spread over the rest (`--every`: each). The line of a fault prints how many of how many.

Expected exit codes (the table in apps/README.md, NoUsableDevice in apps/common/options.hpp, main in apps/main.cpp):
4 if the device hangs; 2 if it fails before or during the self-check, with nothing written; 1 if it fails later or is
lost. 0 only where gflow can continue: out of memory while density control, static Gaussians or row order change the
Gaussians (trainer.cpp), and an intermediate checkpoint that cannot be read from the device
(Checkpointer::try_write), both with a warning; the cache of compiled programs; and the last wait, when everything
is written and the trainer frees its memory (~Trainer)."""
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor

from trial import tell_if_fewer
from world import (broken_checkpoints, checkpoints_of, complaints, contents_under, failed_calls, leaks, settings,
                   unfinished_in)

NAMES = {-2: "CL_DEVICE_NOT_AVAILABLE", -4: "CL_MEM_OBJECT_ALLOCATION_FAILURE", -5: "CL_OUT_OF_RESOURCES",
         -6: "CL_OUT_OF_HOST_MEMORY", -11: "CL_BUILD_PROGRAM_FAILURE", -36: "CL_INVALID_COMMAND_QUEUE",
         -42: "CL_INVALID_BINARY", -61: "CL_INVALID_BUFFER_SIZE"}
HANGS, HANG_SECONDS, HANG_CODE = 1, 5, 4
NAMES[HANGS] = f"no response for {HANG_SECONDS} s"
FOREVER = 10**9
ALL = "setup,build,binary,kernel,argument,create,launch,copy,wait,flush"
# is_out_of_memory() in runtime/base/error.cpp.
OF_MEMORY = (-4, -5, -6, -61)


def calls_of_check(world, kinds, cache):
    """The calls before any work: those of `gflow devices`, which opens and checks a device like every command."""
    report = world.path("device-check.report")
    outcome = world.run(["devices", "--device", os.environ["GFLOW_DEVICE"]], {
        "LD_PRELOAD": world.shims["fail_opencl"], "CLFAULT_KINDS": kinds, "CLFAULT_REPORT": report,
        "GFLOW_CACHE_DIR": cache})
    if outcome.code != 0:
        raise SystemExit(f"without a fault the device must be usable: {outcome.err}")
    calls = [name for _, name in failed_calls(report)[1]]
    os.remove(report)
    return calls


def right_codes(outcome, code, failed, calls, check, count):
    """The allowed exit codes of a fault. failed: the calls that failed; calls: all; check: those before work;
    count: number of calls without a fault."""
    number, name = failed[0]
    of_cache = (name in ("clCreateProgramWithBinary", "clGetProgramInfo") or
                (name == "clBuildProgram" and calls[number - 2][1] == "clCreateProgramWithBinary"))
    if of_cache and {what for _, what in failed} <= {"clCreateProgramWithBinary", "clGetProgramInfo", name}:
        return (0,)
    if code == HANGS:
        return (HANG_CODE,)
    if number <= len(check):
        return (2,)
    if name == "clFinish" and number == count:
        return (0,)
    short = "memory limit reached, training continues" in outcome.err and code in OF_MEMORY
    return (0, 1) if short or goes_on(outcome) else (1,)


def goes_on(outcome):
    """Whether only a checkpoint or the report is missing."""
    return re.fullmatch(r"gflow: warning: (checkpoint of step \d+ not saved: .*; training continues|"
                        r".*report\.html not written: .*; the run itself is complete)\n", outcome.err)


def spread(numbers, first, more):
    """The first ones, and as many spread over the rest."""
    rest = numbers[first:]
    every = max(1, len(rest) // more) if more else len(rest) + 1
    return numbers[:first] + rest[every - 1::every]


def trial(world, tag, kinds, first, last, code, resume, cache="", check=(), count=0):
    """A training, from the start or from step 4, in which the calls first .. last of these kinds fail. cache: of
    compiled programs, "": none; check: the calls before any work; count: number of calls without a fault."""
    run, report = world.path("device-" + tag), world.path(f"device-{tag}.report")
    shutil.rmtree(run, ignore_errors=True)
    if resume:
        shutil.copytree(world.stopped, run)
    outcome = world.run(["train", world.scene, "-o", run, *settings(), *(["--resume"] if resume else [])],
                        {"LD_PRELOAD": world.shims["fail_opencl"], "CLFAULT_KINDS": kinds, "CLFAULT_CALL": str(first),
                         "CLFAULT_LAST": str(last), "CLFAULT_CODE": str(code), "CLFAULT_REPORT": report,
                         "GFLOW_CACHE_DIR": cache,
                         **({"GFLOW_DEVICE_TIMEOUT": str(HANG_SECONDS)} if code == HANGS else {})})
    failed, calls = failed_calls(report)
    left = leaks(report)
    os.remove(report)
    if first == 0:
        shutil.rmtree(run)
        return outcome, calls
    where = f"{NAMES[code]} at call {first}{'' if first == last else ' and all later'}"
    if not failed:
        return [f"{where}: the fault did not strike"]
    where += f" ({failed[0][1]})"
    codes = right_codes(outcome, code, failed, calls, check, count)
    short = "memory limit reached, training continues" in outcome.err
    if outcome.code == 0 and short:
        # Prints one sentence, and the training completes with fewer Gaussians.
        wrong = [] if len(outcome.err.splitlines()) == 1 else [f"more than one sentence: {outcome.err!r}"]
        wrong += [] if NAMES[code] in outcome.err else [f"does not say {NAMES[code]}: {outcome.err!r}"]
        wrong += [] if os.path.exists(run + "/results.json") else ["there are no results"]
        wrong += [] if 0 in codes else [f"it goes on without what it cannot do without: {outcome.err!r}"]
    else:
        wrong = complaints(outcome, codes, [NAMES[code]] if "build log of " not in outcome.err else [])
        wrong += world.differences(run) if outcome.code == 0 else []
        wrong += [f"it succeeds and says {outcome.err!r}"] if (
            outcome.code == 0 and outcome.err and not goes_on(outcome)) else []
    if outcome.code == 2:
        before = contents_under(world.stopped) if resume else {}
        wrong += [] if contents_under(run) == before else ["it refuses the device and has written before"]
    wrong += left + broken_checkpoints(run)
    wrong += [f"{path} was left behind" for path in unfinished_in(run)]
    if resume and not any(step >= 4 for step in checkpoints_of(run)):
        wrong.append("the checkpoint there was is gone")
    saved = re.search(r"(\d+) of \d+ steps are saved", outcome.err)
    if saved and int(saved.group(1)) not in checkpoints_of(run):
        wrong.append(f"there is no checkpoint of step {saved.group(1)}, though it says so")
    if outcome.code:
        wrong += world.resumed_as_undisturbed(run)
    shutil.rmtree(run, ignore_errors=True)
    return [f"{where}: {what}" for what in wrong]


def in_turn(world, name, kinds, codes, first, more, resume, lost=False, cache=""):
    check = calls_of_check(world, kinds, cache)
    outcome, calls = trial(world, name + "-clean", kinds, 0, 0, 0, resume, cache)
    if outcome.code != 0 or not calls:
        yield [f"without a fault: {outcome.last_line()}, {len(calls)} calls"]
        return
    if [what for _, what in calls[:len(check)]] != check:
        yield ["a training does not check the device as gflow devices does"]
        return
    numbers = spread([n for n, _ in calls], first, more)
    tell_if_fewer(numbers, calls)
    jobs = [(f"{name}-{k}", kinds, k, FOREVER if lost else k, codes[i % len(codes)], resume, cache, check, len(calls))
            for i, k in enumerate(numbers)]
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(lambda job: trial(world, *job), jobs)


def caches(world):
    """The program cache cannot be written or read: results are the same, without a message."""
    cold, warm = world.path("kernels-cold"), world.path("kernels")
    outcome = world.train(world.path("device-warm"), {"GFLOW_CACHE_DIR": warm})
    yield complaints(outcome, (0,))
    yield trial(world, "cold", "binary", 1, FOREVER, -6, False, cold)
    yield from in_turn(world, "warm", "binary,build", (-42, -6, -5), FOREVER, 0, False, cache=warm)


def smaller(world):
    """Devices that report little memory: rejected before anything is allocated, or training continues with what
    fits; the device itself never fails."""
    kib = 1 << 10
    small = [("CLFAULT_MEMORY", 0, (2,)), ("CLFAULT_MEMORY", 100 << 20, (2,)),
             ("CLFAULT_LARGEST", 0, (2,)), ("CLFAULT_LARGEST", 64 * kib, (2,)),  # the check needs more
             ("CLFAULT_LARGEST", 256 * kib, (1,)),                               # and Adam's table
             ("CLFAULT_LARGEST", 1024 * kib, (0,)), ("CLFAULT_LARGEST", 256 << 20, (0,))]
    results = []
    for variable, size, codes in small:
        run = world.path("device-small")
        shutil.rmtree(run, ignore_errors=True)
        outcome = world.train(run, small_device(world, variable, size))
        needle = "at least 256 MiB" if variable == "CLFAULT_MEMORY" else "allows at most"
        wrong = complaints(outcome, codes, [needle])
        if outcome.code == 0:
            wrong += world.differences(run) + ([f"says {outcome.err!r}"] if outcome.err else [])
        if "returned CL_" in outcome.err:
            wrong.append(f"the device was asked first: {outcome.err.strip()}")
        results.append([f"{variable[8:].lower()} {size}: {what}" for what in wrong])
    run = world.path("device-fewer")
    outcome = world.run(["train", world.scene, "-o", run, *settings(), "--set", "density.cap=100000"],
                        small_device(world, "CLFAULT_LARGEST", 1024 * kib))
    wrong = complaints(outcome, (0,)) + broken_checkpoints(run)
    wrong += [] if os.path.exists(run + "/results.json") else ["there are no results"]
    said = len(outcome.warnings()) == 1 and "density.cap = 100000 will not be reached" in outcome.err
    wrong += [] if said else [f"says {outcome.err!r}"]
    results.append([f"with fewer Gaussians: {what}" for what in wrong])
    return results


def small_device(world, variable, size):
    return {"LD_PRELOAD": world.shims["fail_opencl"], variable: str(size), "CLFAULT_KINDS": "none"}


def larger_than_it_gives(world):
    """Other commands, whose arrays are as large as their input: rejected before the device is asked, with nothing
    written."""
    still, out = world.path("small.ply"), world.path("small")
    world.run(["export", world.whole, "-o", still, "--quiet"])
    for arguments in (["render", world.whole, "-o", out], ["render", still, "-o", out],
                      ["eval", world.whole, "--quiet"]):
        outcome = world.run(arguments, small_device(world, "CLFAULT_LARGEST", 4 << 10))
        wrong = complaints(outcome, (1, 2), ["allows at most"]) + world.differences(world.whole)
        wrong += ["images were written"] if contents_under(out) else []
        yield [f"{arguments[0]} {os.path.basename(arguments[1])}: {what}" for what in wrong]


def faults(world, every):
    more = FOREVER if every else 0
    few = more or 40
    table = [("allocation", "create", (-4, -61), FOREVER, 0, False),
             ("allocation after a step", "create", (-4, -6, -5), FOREVER, 0, True),
             ("build", "build", (-11, -6, -5), FOREVER, 0, False),
             ("kernel made", "kernel", (-6, -5), 20, few, False),
             ("argument of a kernel", "argument", (-5, -6), 10, few // 2, True),
             ("launch", "launch", (-4, -5, -36), 30, few, False),
             ("launch after a step", "launch", (-4, -5, -36), 40, few, True),
             ("copy, read, write or fill", "copy", (-4, -5, -36), 40, few, True),
             ("wait", "wait", (-5, -36), FOREVER, 0, True),
             ("answer", "wait", (HANGS,), 3, few, True),
             ("context, queue, flush", "setup,flush", (-2, -5, -6), FOREVER, 0, True)]
    for name, kinds, codes, first, others, resume in table:
        what = "never comes" if HANGS in codes else "fails"
        yield f"device: {name} {what}", lambda a=(name.split()[0] + str(resume), kinds, codes, first, others, resume): (
            in_turn(world, *a))
    for resume in (False, True):
        yield f"device: lost {'after' if resume else 'before or in'} the first steps", lambda r=resume: (
            in_turn(world, f"lost{r}", ALL, (-36, -5, -2), 0, few, r, lost=True))
    yield "device: no program can be kept or taken from the cache", lambda: caches(world)
    yield "device: smaller than what is asked of it", lambda: smaller(world)
    yield "device: smaller than a model that is drawn", lambda: larger_than_it_gives(world)
