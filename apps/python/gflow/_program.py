# SPDX-License-Identifier: Apache-2.0
"""What the gflow program does as a whole: its commands as functions."""
import csv
import os
import shutil
import signal
import subprocess

from gflow import _core


def program():
    """Path of the gflow program: GFLOW_PROGRAM, that of the same build, or that on the PATH."""
    own = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "gflow")
    core = os.path.join(os.path.dirname(os.path.abspath(_core.__file__)), "..", "..", "gflow")
    for path in (os.environ.get("GFLOW_PROGRAM"), core, own, shutil.which("gflow")):
        if path and os.path.isfile(path) and os.access(path, os.X_OK):
            return os.path.normpath(path)
    raise _core.Error("the gflow program is not found: install it (the package gflow), or set GFLOW_PROGRAM to its path")


def _words(options):
    words = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            words.append(option)
        elif isinstance(value, (list, tuple)):
            words += [option, *map(str, value)]
        elif value is not None and value is not False:
            words += [option, str(value)]
    return words


def run(*arguments):
    """Runs a command of the program and returns what it prints. Its sentence becomes an exception."""
    process = subprocess.Popen([program(), *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, start_new_session=True)  # else Ctrl-C would reach it twice
    try:
        printed, said = process.communicate()
    except KeyboardInterrupt:
        process.send_signal(signal.SIGINT)  # saves what it has
        process.communicate()
        raise
    if process.returncode == 0:
        return printed
    lines = [line[7:] for line in said.splitlines() if line.startswith("gflow: ")]
    sentence = lines[-1] if lines else said.strip() or f"gflow ended with {process.returncode}"
    if process.returncode == 128 + signal.SIGINT:
        raise KeyboardInterrupt(sentence)
    raise (_core.DeviceError if process.returncode == 2 else _core.Error)(sentence)


def export(model, output, **options):
    """`gflow export`: writes a run folder, a splat file or a gflow.Model for other programs.

    The ending of output decides: .html, .4dgs, .splatv (with motion), .ply, .splat (one time), or a folder with
    format="ply-sequence". options are those of the command: export(run, "scene.html", compact=True, min_opacity=0.05).
    """
    if hasattr(model, "_export"):
        return model._export(output, options)
    run_export(model, output, options)


def run_export(model, output, options):
    run("--quiet", "export", os.fspath(model), "-o", os.fspath(output), *_words(options))


def experiment(file, output=None, **options):
    """`gflow experiment`: runs the trainings of a file, those that are not finished, and returns a dict per training.

        pandas.DataFrame(gflow.experiment("flow.toml", "flow"))

    Keys: run (the name of its folder in output/runs), scene, one per axis, seed, and every metric, None where it is not
    known. output: folder of the runs, tables and report.html; default: the file's name. options are those of the
    command: jobs=2, redo=True. If a training fails the others are made all the same, then Error names it.
    """
    if output is None:
        output = os.path.splitext(os.path.basename(os.fspath(file)))[0]
    run("--quiet", "experiment", os.fspath(file), "-o", os.fspath(output), *_words(options))
    with open(os.path.join(output, "runs.csv"), encoding="utf-8", newline="") as text:
        return [_typed(row) for row in csv.DictReader(text)]


def _typed(row):
    names = list(row)
    after = names.index("seed") + 1  # metrics; before it are names
    return {name: int(row[name]) if name == "seed" else _number(row[name]) if k >= after else row[name]
            for k, name in enumerate(names)}


def _number(text):
    try:
        return float(text)
    except ValueError:
        return None
