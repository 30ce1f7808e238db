"""The device: allocations, copies, launches and builds that fail, devices that are lost, that hang, that are
small."""
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor

from world import broken_checkpoints, checkpoints_of, complaints, failed_calls, settings, unfinished_in

NAMES = {-2: "CL_DEVICE_NOT_AVAILABLE", -4: "CL_MEM_OBJECT_ALLOCATION_FAILURE", -5: "CL_OUT_OF_RESOURCES",
         -6: "CL_OUT_OF_HOST_MEMORY", -11: "CL_BUILD_PROGRAM_FAILURE", -36: "CL_INVALID_COMMAND_QUEUE",
         -42: "CL_INVALID_BINARY", -61: "CL_INVALID_BUFFER_SIZE"}
HANGS, HANG_SECONDS, HANG_CODE = 1, 5, 4
NAMES[HANGS] = f"nothing came back for {HANG_SECONDS} s"
FOREVER = 10**9
ALL = "setup,build,kernel,argument,create,launch,copy,wait,flush"


def spread(numbers, first, more):
    """The first ones, and as many more spread over the rest."""
    rest = numbers[first:]
    every = max(1, len(rest) // more) if more else len(rest) + 1
    return numbers[:first] + rest[every - 1::every]


def trial(world, tag, kinds, first, last, code, resume):
    """A training, from the start or from step 4, in which the calls first .. last of these kinds fail."""
    run, report = world.path("device-" + tag), world.path(f"device-{tag}.report")
    shutil.rmtree(run, ignore_errors=True)
    if resume:
        shutil.copytree(world.stopped, run)
    outcome = world.run(["train", world.scene, "-o", run, *settings(), *(["--resume"] if resume else [])],
                        {"LD_PRELOAD": world.shims["fail_opencl"], "CLFAULT_KINDS": kinds, "CLFAULT_CALL": str(first),
                         "CLFAULT_LAST": str(last), "CLFAULT_CODE": str(code), "CLFAULT_REPORT": report,
                         **({"GFLOW_DEVICE_TIMEOUT": str(HANG_SECONDS)} if code == HANGS else {})})
    failed, calls = failed_calls(report)
    os.remove(report)
    if first == 0:
        shutil.rmtree(run)
        return outcome, calls
    where = f"{NAMES[code]} at call {first}{'' if first == last else ' and all later'}"
    if not failed:
        return [f"{where}: the fault did not strike"]
    where += f" ({failed[0][1]})"
    short = "memory is short" in outcome.err
    if outcome.code == 0 and short:
        # One sentence about it, and the training is worth what it is: with fewer Gaussians.
        wrong = [] if len(outcome.err.splitlines()) == 1 else [f"more than one sentence: {outcome.err!r}"]
        wrong += [] if os.path.exists(run + "/results.json") else ["there are no results"]
    else:
        wrong = complaints(outcome, (HANG_CODE,) if code == HANGS else (0, 1, 2), [NAMES[code]] if "says:" not in outcome.err else [])
        wrong += world.differences(run) if outcome.code == 0 else []
    wrong += broken_checkpoints(run)
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


def in_turn(world, name, kinds, codes, first, more, resume, lost=False):
    outcome, calls = trial(world, name + "-clean", kinds, 0, 0, 0, resume)
    if outcome.code != 0 or not calls:
        yield [f"without a fault: {outcome.last_line()}, {len(calls)} calls"]
        return
    numbers = spread([n for n, _ in calls], first, more)
    jobs = [(f"{name}-{k}", kinds, k, FOREVER if lost else k, codes[i % len(codes)], resume)
            for i, k in enumerate(numbers)]
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(lambda job: trial(world, *job), jobs)


def smaller(world):
    """Devices that say they are small: refused before anything is allocated, or training goes on with what
    fits; never a failure of the device itself."""
    results = []
    kib = 1 << 10
    for variable, size, codes, needles in (
            ("CLFAULT_MEMORY", 100 << 20, (2,), ["at least 256 MiB"]),
            ("CLFAULT_MEMORY", 0, (2,), ["at least 256 MiB"]),
            ("CLFAULT_LARGEST", 0, (1, 2), ["gives at most 0.0 MiB"]),
            ("CLFAULT_LARGEST", 16 * kib, (1, 2), ["gives at most"]),
            ("CLFAULT_LARGEST", 64 * kib, (0, 1), ["gives at most"]),
            ("CLFAULT_LARGEST", 256 * kib, (0, 1), ["gives at most"]),
            ("CLFAULT_LARGEST", 512 * kib, (0, 1), ["gives at most"]),
            ("CLFAULT_LARGEST", 1024 * kib, (0, 1), ["gives at most"]),
            ("CLFAULT_LARGEST", 256 << 20, (0,), [])):
        run, report = world.path("device-small"), world.path("device-small.report")
        shutil.rmtree(run, ignore_errors=True)
        outcome = world.train(run, {"LD_PRELOAD": world.shims["fail_opencl"], variable: str(size),
                                    "CLFAULT_KINDS": "none"})
        if outcome.code == 0 and outcome.err:
            wrong = [] if "memory is short" in outcome.err else [f"says {outcome.err!r}"]
        else:
            wrong = complaints(outcome, codes, needles)
            wrong += world.differences(run) if outcome.code == 0 else []
        if "returned CL_" in outcome.err:
            wrong.append(f"the device was asked first: {outcome.err.strip()}")
        results.append([f"{variable[8:].lower()} {size}: {what}" for what in wrong])
    return results


def faults(world, every):
    more = FOREVER if every else 0
    few = more or 40
    table = [("allocation", "create", (-4, -61), FOREVER, 0, False),
             ("allocation after a step", "create", (-4, -6, -5), FOREVER, 0, True),
             ("build", "build", (-11, -6), FOREVER, 0, False),
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
    yield "device: smaller than what is asked of it", lambda: smaller(world)
