"""Reads the files of two folders and reports the first difference between them."""
import csv
import json

import numpy as np

# Names that NEW has changed since OLD, of JSON keys, CSV columns, arrays, files and folders: {"new": "old"}.
RENAMED = {"rejected": "refused"}
# JSON keys and CSV columns that measure time or memory, the array of a checkpoint with its settings and version, and
# keys that OLD did not write.
VARYING = {"seconds", "train_seconds", "peak_memory_mib", "facts", "time"}
# Files that contain only settings, times or versions, and movies: their encoder changed since OLD. Their frames are
# compared as images.
IGNORED = {"config.toml", "training.json", "report.html", "caches.stamp", ".lock", "cam00.mp4", "compare_cam00.mp4"}
# Formats compared by value only: archives contain dates, text contains times.
BY_VALUE = {".npz", ".json", ".jsonl", ".csv"}
PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4", "uint": "<u4"}


def renamed(items):
    return {RENAMED.get(name, name): value for name, value in items if name not in VARYING}


def flat(value, name=""):
    """Nested JSON as {".a.0.b": leaf}; empty lists and objects are leaves."""
    if not isinstance(value, (dict, list)) or not value:
        return {name: value}
    parts = renamed(value.items()) if isinstance(value, dict) else dict(enumerate(value))
    return {path: leaf for key, part in parts.items() for path, leaf in flat(part, f"{name}.{key}").items()}


def contents(path):
    """{name: array, number or text} of a file."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return renamed((name, arrays[name]) for name in arrays.files)
    if path.suffix == ".json":
        return flat(json.loads(path.read_text()))
    if path.suffix == ".jsonl":
        return flat([json.loads(line) for line in path.read_text().splitlines()])
    if path.suffix == ".csv":
        with open(path, newline="") as file:
            return flat(list(csv.DictReader(file)))
    if path.suffix == ".npy":
        return {"array": np.load(path)}
    data = path.read_bytes()
    if path.suffix == ".flo":
        return {"header": data[:12], "flow": np.frombuffer(data[12:], "<f4")}
    if path.suffix == ".ply":
        header, _, rows = data.partition(b"end_header\n")
        properties = [line.split() for line in header.decode().splitlines() if line.startswith("property ")]
        rows = np.frombuffer(rows, [(name, PLY_TYPES[kind]) for _, kind, name in properties])
        return {"header": header, **{name: rows[name] for name in rows.dtype.names}}
    return {"bytes": data}


def number_of(value):
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        return None


def difference_of_values(old, new):
    """How two values differ, or "". Arrays are compared by their bytes, so NaN equals NaN."""
    if isinstance(old, np.ndarray) and isinstance(new, np.ndarray):
        if old.dtype != new.dtype or old.shape != new.shape:
            return f"{old.dtype}{list(old.shape)} became {new.dtype}{list(new.shape)}"
        if old.tobytes() == new.tobytes():
            return ""
    elif type(old) is type(new) and old == new:
        return ""
    if isinstance(old, bytes):
        return f"{sum(a != b for a, b in zip(old, new))} bytes differ, lengths {len(old)} and {len(new)}"
    before, now = number_of(old), number_of(new)
    if before is None or now is None:
        return f"{old!r} became {new!r}"
    return f"max abs difference {np.max(np.abs(before - now)):.3g}"


def difference_of_files(old, new):
    if old.read_bytes() == new.read_bytes():
        return ""
    try:
        before, now = contents(old), contents(new)
    except (ValueError, KeyError, IndexError):
        return "other bytes, and at least one file is damaged or of an unknown format"
    for name, value in before.items():
        how = difference_of_values(value, now[name]) if name in now else "missing"
        if how:
            return f"{name.lstrip('.')}: {how}"
    added = [name.lstrip(".") for name in now if name not in before]
    if added:
        return f"{added[0]}: new"
    return "" if old.suffix in BY_VALUE else "same values, other bytes"


def files_in(folder):
    """{name that OLD used: path}. Only the last checkpoint counts: a run that was stopped has others before it."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in IGNORED]
    checkpoints = [path for path in paths if path.parent.name == "checkpoints"]
    earlier = sorted(checkpoints, key=lambda path: int(path.stem.split("_")[1]))[:-1]
    return {"/".join(RENAMED.get(part, part) for part in path.relative_to(folder).parts): path
            for path in paths if path not in earlier}


def difference_of_folders(old, new):
    """How many files differ, and the first difference; "" if there is none."""
    before, now = files_in(old), files_in(new)
    if not before:
        return "OLD wrote nothing"
    hows = {name: difference_of_files(path, now[name]) if name in now else "missing" for name, path in before.items()}
    hows.update((name, "new") for name in now if name not in before)
    found = [f"{name}: {how}" for name, how in hows.items() if how]
    return f"{len(found)} of {len(before)} files differ; {found[0]}" if found else ""
