"""Pictures for the tests of files: one with every kind of array."""

import numpy as np

import wavefront as wf

HEIGHT, WIDTH = 5, 7


def with_everything(background="transparent"):
    """A picture of noise with layers of every type, errors, counts, names and nested metadata."""
    rng = np.random.default_rng(3)

    def noise(*components):
        return rng.random((HEIGHT, WIDTH, *components), np.float32)

    alpha = noise()
    alpha[0], alpha[1] = 0, 1
    depth = noise()
    depth[2, 2:5] = np.nan
    return wf.Image(
        noise(3) * alpha[..., None],
        spp=16,
        metadata={
            "background": background,
            "seed": 7,
            "noise": float("nan"),
            "seconds": 0.1,
            "sampler": "sobol",
            "lighting": None,
            "interrupted": False,
            "samples": 2**40,
            "sizes": [1, {"width": 2.5}],
        },
        counts=rng.integers(0, 100, (HEIGHT, WIDTH)),
        variance=noise(3),
        standard_error=noise(3),
        layers={
            "alpha": alpha,
            "depth": depth,
            "normal": noise(3) * 2 - 1,
            "uv": noise(2),
            "shape_id": rng.integers(-1, 3, (HEIGHT, WIDTH), np.int32),
            "light_groups.kéy light": noise(3),
            "coverage.a.b": noise(),
        },
        errors={"alpha": noise(), "light_groups.kéy light": noise(3)},
        names={"shape": {0: "ball", 1: "floor ü", 2: "c"}},
    )
