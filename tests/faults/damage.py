"""Damaged checkpoints on disk: gflow reads what was written, or the previous checkpoint."""
import os
import random
import shutil
import zipfile
from concurrent.futures import ThreadPoolExecutor

from world import checkpoints_of, complaints, content

FLIPS = 1000


def shown(outcome, run):
    """The output of `gflow info` for a model, without fields that only one of two models has."""
    return outcome.out.replace(run, "RUN")


def stored(path):
    """Byte ranges of the arrays in an .npz: damage there must be detected."""
    spans = []
    with zipfile.ZipFile(path) as archive, open(path, "rb") as file:
        for entry in archive.infolist():
            file.seek(entry.header_offset + 26)
            name, extra = (int.from_bytes(file.read(2), "little") for _ in range(2))
            begin = entry.header_offset + 30 + name + extra
            spans.append(range(begin, begin + entry.compress_size))
    return spans


def damaged(world, damages):
    """Damages the newest of two checkpoints in various ways."""
    source = world.path("damage")
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(world.whole, source)
    shutil.rmtree(source + "/point_cloud")
    before, newest = checkpoints_of(source)[-2:]
    data, arrays = content(world.checkpoint(source, newest)), stored(world.checkpoint(source, newest))
    right = shown(world.run(["info", source]), source)
    os.rename(world.checkpoint(source, newest), world.path("newest.npz"))
    older = shown(world.run(["info", source]), source)

    def trial(job):
        i, (name, damage, at) = job
        run = world.path(f"damage-{i}")
        shutil.copytree(source, run)
        path = world.checkpoint(run, newest)
        with open(path, "wb") as file:
            file.write(damage(data))
        outcome = world.run(["info", run])
        shutil.rmtree(run)
        wrong = complaints(outcome, (0,))
        now = shown(outcome, run)
        if now == right and not outcome.err:
            said_nothing = at is not None and not any(at in span for span in arrays)
            return wrong if said_nothing else wrong + [f"{name}: nobody noticed"]
        if [line for line in now.splitlines() if not line.startswith("saved iterations")] != [
                line for line in older.splitlines() if not line.startswith("saved iterations")]:
            wrong.append(f"shows neither the newest checkpoint nor the one before: {now}")
        if len(outcome.err.splitlines()) != 1 or path not in outcome.err or str(before) not in outcome.err:
            wrong.append(f"not one warning that names both: {outcome.err!r}")
        return [f"{name}: {what}" for what in wrong]

    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(trial, enumerate(damages(data)))


def flips(data):
    random.seed(4)
    for _ in range(FLIPS):
        at, bit = random.randrange(len(data)), random.randrange(8)
        yield (f"bit {bit} of byte {at}",
               lambda data, at=at, bit=bit: data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1:],
               at)


def cuts(data):
    for length in [*range(0, len(data), 4096), len(data) - 1]:
        yield f"cut off at {length}", lambda data, length=length: data[:length], None


def resumed(world):
    """The newest checkpoint of an interrupted training is damaged: it resumes from the previous one, or
    reports that there is none."""
    results = []
    for name, steps in (("the last of two", (8,)), ("both", (4, 8))):
        run = world.path("damage-resumed")
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(world.stopped, run)
        shutil.copy(world.checkpoint(world.whole, 8), world.checkpoint(run, 8))
        for step in steps:
            os.truncate(world.checkpoint(run, step), 100_000)
        outcome = world.resume(run)
        if len(steps) == 1:
            wrong = complaints(outcome, (0,)) + world.differences(run)
            wrong += [] if len(outcome.warnings()) == 1 else [f"warnings: {outcome.err!r}"]
        else:
            wrong = complaints(outcome, (1,), ["no usable checkpoint", world.checkpoint(run, 4), "--overwrite"])
        results.append([f"{name}: {what}" for what in wrong])
    return results


def faults(world, every):
    yield f"damage: {FLIPS} bits of a checkpoint flipped", lambda: damaged(world, flips)
    yield "damage: a checkpoint cut off at every 4 kB", lambda: damaged(world, cuts)
    yield "damage: resumed from damaged checkpoints", lambda: resumed(world)
