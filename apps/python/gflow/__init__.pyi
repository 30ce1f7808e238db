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
