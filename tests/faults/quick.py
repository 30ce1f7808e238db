"""The few cases that run with all tests in seconds: one of each kind that has found a bug."""
import device
import disk
import stops
import surroundings
import trial


def faults(world, every):
    trials = disk.trials(world)
    yield "disk: every write of import", lambda: trial.every_call(trials["import"], every)
    yield "disk: the log of a training", lambda: trial.chosen_calls(trials["resume"], "metrics.jsonl", 1)
    yield "device: an allocation fails after a step", lambda: device.in_turn(
        world, "quick", "create", (-4,), 0, 1, True)
    yield "device: lost after a step", lambda: device.in_turn(world, "quick lost", device.ALL, (-36,), 0, 1, True, True)
    yield "device: hangs after a step", lambda: device.in_turn(world, "quick hang", "wait", (device.HANGS,), 0, 2, True)
    yield "surroundings: no OpenCL driver", lambda: surroundings.no_driver(world)
    yield "stops: signals that are ignored (nohup)", lambda: stops.ignored(world)
