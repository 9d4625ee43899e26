"""Denoising by Intel Open Image Denoise, through pyoidn."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays.vec import Floats
from ..core.errors import RenderError, SceneError
from .noisy import Guide, NoisyPicture

SMALLEST = 64  # pixels along a side; smaller pictures are extended, since the network sees black beyond
LARGEST = np.float32(65504)  # radiance that the network's half floats hold
MOST_MEMORY = (
    800  # MB that a network takes, about; larger pictures go through it in parts, with the same bits
)
FEW = 16  # samples per pixel; with fewer, more samples lower the error sooner than denoised guides do


def open_image_denoise(picture: NoisyPicture) -> Floats:
    """Return the picture without its noise, (H, W, 3).

    Each guide is denoised by itself first, as the library's documentation recommends for noisy ones
    (https://github.com/RenderKit/oidn, "RT": prefiltering the auxiliary images), in its balanced quality,
    which leaves no more error in the picture than the high one. A picture of few samples takes noisy guides
    and one small network, in an eighth of the time.

    Raises
    ------
    SceneError
        If pyoidn is not installed.
    RenderError
        If the library reports an error.
    """
    try:
        import pyoidn
    except ImportError:
        raise SceneError(
            'denoiser "oidn" needs pyoidn: pip install pyoidn; "nonlocal_means" needs nothing'
        ) from None
    with pyoidn.Device() as device:
        device.commit()
        guides: dict[str, Floats] = {}
        if picture.albedo is not None:
            guides["albedo"] = _values(picture.albedo, 0)
        if guides and picture.normal is not None:  # the library takes no normal without an albedo
            guides["normal"] = _values(picture.normal, -1)
        clean = not 0 < picture.spp < FEW and bool(guides)
        if clean:
            balanced = {"quality": pyoidn.OIDN_QUALITY_BALANCED}
            guides = {name: _run(device, {name: values}, **balanced) for name, values in guides.items()}
        color = np.clip(picture.rgb, 0, LARGEST)
        return _run(device, {"color": color, **guides}, hdr=True, cleanAux=clean)


def _values(guide: Guide, low: float) -> Floats:
    return np.clip(guide.values, low, 1)


def _run(device: Any, images: dict[str, Floats], **options: int) -> Floats:
    """Return the output of one filter; its options are numbers or switches."""
    import pyoidn

    height, width = next(iter(images.values())).shape[:2]
    # these arrays must live until the filter is done
    inputs = {name: _extended(values) for name, values in images.items()}
    output = np.empty_like(next(iter(inputs.values())))
    with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as network:
        for name, values in (*inputs.items(), ("output", output)):
            network.set_image(name, values, pyoidn.OIDN_FORMAT_FLOAT3)
        for name, value in {"maxMemoryMB": MOST_MEMORY, **options}.items():
            (network.set_bool if isinstance(value, bool) else network.set_int)(name, value)
        network.commit()
        network.execute()
        error = device.get_error()
    if error is not None:
        raise RenderError(f"Open Image Denoise: {error}")
    return output[:height, :width]


def _extended(values: Floats) -> Floats:
    """Return values (H, W, 3), with themselves mirrored beside them where they are too small."""
    missing = [(0, max(0, SMALLEST - length)) for length in values.shape[:2]]
    return np.ascontiguousarray(np.pad(values, (*missing, (0, 0)), mode="symmetric"), np.float32)
