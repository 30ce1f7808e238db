import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

class Error(Exception): ...
class InputError(Error, ValueError): ...
class DeviceError(Error, RuntimeError): ...
class OutOfMemoryError(Error, MemoryError): ...

def rasterization(
    means: ArrayLike,
    quats: ArrayLike,
    scales: ArrayLike,
    opacities: ArrayLike,
    colors: ArrayLike,
    viewmats: ArrayLike,
    Ks: ArrayLike,
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: Literal[False] = False,
    tile_size: Literal[16] = 16,
    backgrounds: ArrayLike | None = None,
    render_mode: Literal["RGB", "D", "ED", "RGB+D", "RGB+ED"] = "RGB",
    sparse_grad: Literal[False] = False,
    absgrad: Literal[False] = False,
    rasterize_mode: Literal["classic"] = "classic",
    channel_chunk: Literal[32] = 32,
    distributed: Literal[False] = False,
    camera_model: Literal["pinhole"] = "pinhole",
    segmented: Literal[False] = False,
    covars: None = None,
    *,
    means_t2: ArrayLike | None = None,
    quats_t2: ArrayLike | None = None,
    scales_t2: ArrayLike | None = None,
    viewmats_t2: ArrayLike | None = None,
    transport: Literal["material", "paper", "ot", "translate"] = "material",
    top_k: int = 0,
    stop: Literal["exclude", "include"] = "exclude",
) -> tuple[NDArray[np.float32], NDArray[np.float32], dict[str, Any]]: ...
def devices() -> list[dict[str, Any]]: ...
def device(wanted: int | str | None = None) -> str: ...

_Path = str | os.PathLike[str]

class Camera:
    viewmat: NDArray[np.float64]
    K: NDArray[np.float64]
    width: int
    height: int
    name: str
    position: NDArray[np.float64]
    def __init__(self, viewmat: ArrayLike, K: ArrayLike, width: int, height: int, name: str = "") -> None: ...
    def resized(self, width: int, height: int) -> Camera: ...

class View:
    name: str
    camera: Camera
    time: float
    step: int
    track: int
    split: Literal["train", "test", "val"]
    def image(self) -> NDArray[np.uint8]: ...
    def true_flow(self) -> tuple[NDArray[np.float32], NDArray[np.bool_], float] | None: ...

class Scene:
    train: list[View]
    test: list[View]
    val: list[View]
    cameras: list[Camera]
    points: tuple[NDArray[np.float64], NDArray[np.uint8] | None]
    origin: NDArray[np.float64]
    name: str
    path: str
    layout: str
    steps: int
    fps: float
    extent: float
    near_plane: float
    notices: list[str]
    def __init__(self, path: _Path, resolution: Literal[1, 2, 4, 8] = 1, **settings: Any) -> None: ...
    @classmethod
    def of(
        cls,
        images: Iterable[NDArray[np.uint8]],
        cameras: Iterable[Camera],
        times: Iterable[float],
        *,
        tracks: Iterable[int] | None = None,
        splits: Iterable[Literal["train", "test", "val"]] | None = None,
        points: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        fps: float = 24.0,
    ) -> Scene: ...

class Pictures:
    colors: NDArray[np.float32]
    alphas: NDArray[np.float32]
    depth: NDArray[np.float32]
    flow: NDArray[np.float32] | None
    def image(self) -> NDArray[np.uint8]: ...

class Model:
    motion: str
    moving: int
    sh_degree: int
    origin: NDArray[np.float64]
    near_plane: float
    state: str
    @classmethod
    def load(cls, path: _Path, iteration: int | None = None) -> Model: ...
    def __len__(self) -> int: ...
    def save(self, path: _Path, **options: Any) -> None: ...
    def parameters(self) -> dict[str, NDArray[np.float32]]: ...
    def at(self, t: float) -> dict[str, Any]: ...
    def render(
        self,
        camera: Camera,
        t: float,
        t2: float | None = None,
        *,
        camera_t2: Camera | None = None,
        background: Sequence[float] = (1.0, 1.0, 1.0),
        near_plane: float | None = None,
    ) -> Pictures: ...

class TrainState:
    step: int
    steps: int
    loss: float
    terms: dict[str, float]
    gaussians: int
    moving: int
    model: Model

class TrainResult:
    model: Model
    steps: int
    run: str | None
    metrics: dict[str, Any] | None
    report: str | None

class RenderedView(SimpleNamespace):
    colors: NDArray[np.float32]
    alphas: NDArray[np.float32]
    depth: NDArray[np.float32] | None
    flow: NDArray[np.float32] | None
    truth: NDArray[np.float32]
    step: int
    name: str
    time: float
    time_t2: float
    left: int
    top: int
    share: float

class Objective:
    name: str
    channels: Sequence[Literal["depth", "flow"]]
    def __call__(self, view: RenderedView) -> tuple[float, Mapping[str, ArrayLike]]: ...

def train(
    scene: _Path | Scene,
    /,
    run: _Path | None = None,
    callback: Callable[[TrainState], Any] | None = None,
    *,
    every: int = 1,
    objectives: Iterable[Objective] = (),
    quality: Literal["", "draft", "standard", "best"] = "",
    config: _Path = "",
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
    iterations: int | None = None,
    resolution: Literal[1, 2, 4, 8] | None = None,
    seed: int | None = None,
    **settings: Any,
) -> TrainResult: ...
def settings() -> list[dict[str, str]]: ...
def optical_flow(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]: ...
def export(model: _Path | Model, output: _Path, **options: Any) -> None: ...
def experiment(file: _Path, output: _Path | None = None, **options: Any) -> list[dict[str, Any]]: ...
