# SPDX-License-Identifier: Apache-2.0
"""The other side of guidance.provider = "process": serves a Python function to gflow.

    from gflow_guidance import Answer, serve

    def guide(request):
        return [Answer(gradient=view.rgb - wanted(view)) for view in request.views]

    serve(guide)

numpy only. From the import on, standard output is for answers, and print() writes to standard error.
The protocol is in README.md beside this file.
"""
import json
import mmap
import os
import sys
from dataclasses import dataclass
from typing import List, Optional

try:
    import numpy as np
except ImportError:  # told as fail() does, before there is anything to serve
    print(json.dumps({"error": f"{sys.executable} has no numpy: install it or use another Python"}))
    sys.exit(1)

VERSION = 1  # of the protocol


def _own_output():
    """Standard output as it was; from now on what is printed goes to standard error."""
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return output


_output = _own_output()  # for answers alone: even what is printed while loading must not get there


@dataclass
class Camera:
    name: str  # that of a camera of the scene, or "" for a view drawn by lot
    width: int  # [px]
    height: int
    K: np.ndarray  # [3, 3]; pixel centres at .5, x right, y down
    viewmat: np.ndarray  # [4, 4] world to camera, +z ahead


@dataclass
class View:
    camera: Camera
    azimuth: float  # as seen from the reference camera, counter-clockwise from above [degrees]
    elevation: float  # upwards [degrees]
    distance: float  # further away [scene units]
    timestep: float  # drawn for score distillation: share of the timesteps, in [0, 1]
    rgb: np.ndarray  # [3, H, W] float32, rendered
    flow: Optional[np.ndarray]  # [2, H, W] rendered, to next_time [px]; None unless it is wanted


@dataclass
class Reference:
    camera: Camera
    rgb: np.ndarray  # [3, H, W] filmed at the same time, on the background


@dataclass
class Request:
    step: int
    steps: int
    progress: float  # [0, 1] share of the steps with guidance that is over
    seed: int  # of every random choice: the same request must get the same answer
    time: float  # [0, 1]
    frame: int  # number of the time step, from 0
    background: np.ndarray  # [3]
    next_time: Optional[float]  # where a flow would lead to; None: no flow is wanted
    next_frame: Optional[int]  # the number of that time step: frame + 1 unless steps are left out
    reference: Reference
    views: List[View]


@dataclass
class Answer:
    """What is wanted of one view. The loss whose gradient this is counts per pixel value: gflow
    takes the mean, so rgb - target asks for the least mean squared error (half of it)."""

    gradient: Optional[np.ndarray] = None  # [3, H, W]
    weight: float = 1
    flow: Optional[np.ndarray] = None  # [2, H, W] that the view should show [px]
    flow_weight: float = 1
    confidence: Optional[np.ndarray] = None  # [H, W] of the flow: bool, uint8 (255 = 1) or float


class _Memory:
    """Memory that gflow shares, mapped once: its name is gone after the first answer."""

    def __init__(self):
        self._name = None
        self._map = None

    def use(self, name, size):
        if name == self._name:
            return
        if self._map is not None:
            self._map.close()
        file = os.open("/dev/shm" + name, os.O_RDWR)
        try:
            self._map = mmap.mmap(file, size)
        finally:
            os.close(file)
        self._name = name

    def read(self, place, dtype=np.float32):
        count = int(np.prod(place["shape"]))
        array = np.frombuffer(self._map, dtype, count, place["offset"])
        return array.reshape(place["shape"]).copy()

    def write(self, place, values, dtype=np.float32):
        """The shape written, to be told; what does not fit is told without being written."""
        values = np.ascontiguousarray(values, dtype)
        if list(values.shape) == place["shape"]:
            begin = place["offset"]
            self._map[begin : begin + values.nbytes] = values.tobytes()
        return list(values.shape)


def _camera(text):
    return Camera(
        text["name"],
        text["width"],
        text["height"],
        np.array(text["K"], float),
        np.array(text["viewmat"], float),
    )


def _view(text, memory):
    flow = memory.read(text["flow"]) if "flow" in text else None
    return View(
        _camera(text["camera"]),
        text["azimuth"],
        text["elevation"],
        text["distance"],
        text["timestep"],
        memory.read(text["rgb"]),
        flow,
    )


def _request(text, memory):
    reference = text["reference"]
    return Request(
        text["step"],
        text["steps"],
        text["progress"],
        text["seed"],
        text["time"],
        text["frame"],
        np.array(text["background"], np.float32),
        text["next_time"],
        text["next_frame"],
        Reference(_camera(reference["camera"]), memory.read(reference["rgb"])),
        [_view(view, memory) for view in text["views"]],
    )


def _as_bytes(confidence):
    confidence = np.asarray(confidence)
    if confidence.dtype == np.uint8:
        return confidence
    return np.clip(np.rint(confidence.astype(float) * 255), 0, 255).astype(np.uint8)


def _told(answer, places, memory):
    for name in ("weight", "flow_weight"):
        if not np.isfinite(getattr(answer, name)):  # JSON has no such numbers
            raise ValueError(f"the {name} of an answer is {getattr(answer, name)}; it must be finite")
    told = {"weight": float(answer.weight), "flow_weight": float(answer.flow_weight)}
    if answer.gradient is not None:
        told["gradient"] = memory.write(places["gradient"], answer.gradient)
    if answer.flow is not None and "target_flow" in places:
        told["flow"] = memory.write(places["target_flow"], answer.flow)
        if answer.confidence is not None:
            confidence = _as_bytes(answer.confidence)
            told["confidence"] = memory.write(places["confidence"], confidence, np.uint8)
    return told


def fail(sentence):
    """Ends the program before it serves; gflow shows the sentence."""
    _say({"error": sentence})
    sys.exit(1)


def _say(message):
    _output.write(json.dumps(message) + "\n")
    _output.flush()


def serve(guide):
    """Calls guide(request) for each request, which returns an Answer a view; until gflow ends."""
    memory = _Memory()
    for line in sys.stdin:
        message = json.loads(line)
        if message.get("protocol") == "gflow-guidance":
            _say({"version": VERSION})
            continue
        try:
            memory.use(message["memory"]["name"], message["memory"]["bytes"])
            answers = guide(_request(message, memory))
            if len(answers) != len(message["views"]):
                raise ValueError(f"{len(answers)} answers for {len(message['views'])} views")
            views = [_told(a, v, memory) for a, v in zip(answers, message["views"])]
        except Exception as problem:  # gflow must be told, whatever it is
            _say({"error": f"{type(problem).__name__}: {problem}"})
            raise
        _say({"views": views})
