# SPDX-License-Identifier: Apache-2.0
"""How a rasterization gets on with the rest of a program: threads, Ctrl-C, memory, forks."""
import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from scenes import SIZE, scene, single, without_motion

import gflow

HERE = os.path.dirname(__file__)


def many_views(count):
    s = single(without_motion(scene()))
    return {**s, **{name: np.repeat(s[name], count, 0) for name in ("viewmats", "Ks", "backgrounds")}}


def test_other_threads_run_meanwhile():
    gflow.device()
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    s = single(without_motion(scene(n=20000)))
    gflow.rasterization(**s, width=64, height=64)  # compiled
    before, start = counted[0], time.time()
    gflow.rasterization(**s, width=640, height=480)
    seconds, during = time.time() - start, counted[0] - before
    done.set()
    thread.join()
    assert during >= 0.1 * seconds / 0.001, f"counted to {during} in {seconds:.2f} s"


def test_threads_render_the_same_images():
    s = single(scene(cameras=2))
    expected = gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])
    results = [None] * 4

    def render(i):
        results[i] = [gflow.rasterization(**s, width=SIZE[0], height=SIZE[1]) for _ in range(10)]

    threads = [threading.Thread(target=render, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for rendered in results:
        for colors, _, meta in rendered:
            np.testing.assert_array_equal(colors, expected[0])
            np.testing.assert_array_equal(meta["flow"], expected[2]["flow"])


def test_ctrl_c_stops_a_batch():
    gflow.device()
    s = many_views(20000)
    timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
    timer.start()
    start = time.time()
    with pytest.raises(KeyboardInterrupt):
        gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])
        time.sleep(1)  # it was faster than the signal
    assert time.time() - start < 1.2
    gflow.rasterization(**many_views(1), width=SIZE[0], height=SIZE[1])  # as before


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no /proc")
def test_two_thousand_calls_keep_no_memory():
    torch = pytest.importorskip("torch")
    import gflow.torch
    s = {name: torch.tensor(array) for name, array in single(scene(n=200, sh_degree=1)).items()}
    s["means"].requires_grad_()
    s["viewmats"].requires_grad_()

    def step():
        colors, _, meta = gflow.torch.rasterization(**s, width=SIZE[0], height=SIZE[1], sh_degree=1)
        (colors.sum() + meta["flow"].sum()).backward()

    gc.disable()  # nothing waits for the collector of cycles
    try:
        for _ in range(300):
            step()
        before = resident()
        for _ in range(2000):
            step()
    finally:
        gc.enable()
    grown = (resident() - before) / 2**20
    # One image or array of a call is 3 to 50 KB: a leak of one would be 6 MB.
    assert grown < 4, f"grew by {grown:.1f} MB"


def _in_child(queue):
    try:
        gflow.rasterization(**many_views(1), width=SIZE[0], height=SIZE[1])
        queue.put("rendered")
    except gflow.Error as error:
        queue.put(str(error))


def test_a_forked_process_is_told_to_spawn():
    gflow.device()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(queue,))
    child.start()
    assert "start it with multiprocessing.get_context('spawn')" in queue.get(timeout=60)
    child.join()


def run(code, **environment):
    return subprocess.run([sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True,
                          text=True)


def test_an_unknown_device_is_an_error():
    done = run("import gflow\ntry:\n    gflow.device()\nexcept gflow.DeviceError as error:\n    print(error)",
               GFLOW_DEVICE="abacus")
    assert done.stdout.startswith("no OpenCL device matches 'abacus'; available: 0: "), done.stderr


def test_help_is_readable():
    done = run("import gflow; help(gflow); help(gflow.rasterization)")
    assert "colors [C, H, W, X]" in done.stdout and "gflow.torch" in done.stdout and not done.stderr
    signatures = ("rasterization(means, quats", "train(scene, /, run")
    lines = [line for line in done.stdout.splitlines() if not any(start in line for start in signatures)]
    assert max(map(len, lines)) < 140


def test_importing_does_not_open_a_device_or_import_torch():
    done = run("import sys, gflow; assert 'torch' not in sys.modules; print('imported')", GFLOW_DEVICE="abacus")
    assert done.stdout == "imported\n"


def test_the_example_fits_an_image():
    pytest.importorskip("torch")
    example = os.path.join(HERE, "../../apps/python/examples/fit_image.py")
    done = subprocess.run([sys.executable, example], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[-2]) > 25
