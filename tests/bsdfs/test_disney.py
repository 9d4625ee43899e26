"""Disney's materials: values and densities of Mitsuba 3.9.1, variant scalar_rgb."""

import numpy as np
import pytest
from inside import SurfaceInteraction

import wavefront as wf

F4 = np.float32
# cosine and azimuth of wo and wi
PAIRS = [
    ((0.9, 0.3), (0.8, 3.5)),
    ((0.3, 1.0), (0.4, 4.0)),
    ((0.15, 2.0), (0.1, 5.3)),
    ((0.7, 0.5), (0.6, 0.4)),
    ((0.95, 0.0), (-0.9, 3.0)),
    ((0.5, 1.0), (-0.7, 4.4)),
    ((0.98, 0.0), (-0.2, 3.0)),  # a facet that both see from the front
]
BASE = {"roughness": 0.4, "anisotropic": 0.6, "flatness": 0.7, "sheen": 0.8, "sheen_tint": 0.4}
BASE |= {"specular_tint": 0.5, "base_color": (0.9, 0.5, 0.1)}
COAT = {"metallic": 0.3, "clearcoat": 0.9, "clearcoat_gloss": 0.3}
OPAQUE = wf.Disney(ior=1.3, **BASE, **COAT)
CLEAR = wf.Disney(transmission=0.6, **BASE, **COAT)
SHEET = wf.ThinDisney(ior=1.4, transmission=0.7, diffuse_transmission=1.2, **BASE)
LOW = wf.ThinDisney(ior=0.8, transmission=0.7, diffuse_transmission=1.2, **BASE)
BLACK = wf.Disney(ior=1.3, **BASE | COAT | {"base_color": 0, "clearcoat_gloss": 1})
GLASSY = wf.Disney(transmission=1, **BASE, **COAT)
VALUES = {  # f times the cosine
    "opaque": (
        OPAQUE,
        [
            (0.72594, 0.422023, 0.118106),
            (0.486162, 0.329208, 0.172255),
            (0.135281, 0.107326, 0.0793719),
            (0.121342, 0.0676854, 0.0140284),
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
        ],
    ),
    "clear": (
        CLEAR,
        [
            (0.689663, 0.409155, 0.128647),
            (0.447116, 0.314102, 0.181088),
            (0.122643, 0.101316, 0.0799889),
            (0.0514225, 0.0288887, 0.0063549),
            (0.146428, 0.109141, 0.0488092),
            (0.0348713, 0.0259915, 0.0116238),
            (0.0, 0.0, 0.0),
        ],
    ),
    "sheet": (
        SHEET,
        [
            (0.0738782, 0.0500893, 0.0263004),
            (0.117306, 0.102151, 0.0869966),
            (0.0511811, 0.0474213, 0.0436616),
            (0.0203966, 0.011389, 0.00238147),
            (2.83973, 1.57763, 0.315526),
            (0.426976, 0.237209, 0.0474417),
            (0.0103132, 0.00572958, 0.00114592),
        ],
    ),
    "sheet of a low index": (
        LOW,
        [
            (0.0475802, 0.0314788, 0.0153774),
            (0.669592, 0.660178, 0.650763),
            (0.101709, 0.0984533, 0.0951979),
            (0.0202081, 0.0112523, 0.00229654),
            (0.106249, 0.059027, 0.0118054),
            (0.0388875, 0.0216042, 0.00432084),
            (0.0103132, 0.00572958, 0.00114592),
        ],
    ),
    "clear, from inside": (
        CLEAR,
        [
            (0.0500298, 0.0500298, 0.0500298),
            (0.387523, 0.387523, 0.387523),
            (0.0550754, 0.0550754, 0.0550754),
            (0.000223941, 0.000223941, 0.000223941),
            (7.17708, 5.34948, 2.39236),
            (0.0137172, 0.0102242, 0.00457241),
            (0.0, 0.0, 0.0),
        ],
    ),
    "glossy coat, black base": (
        BLACK,
        [
            (0.0416815, 0.0416815, 0.0416815),
            (0.139177, 0.139177, 0.139177),
            (0.0823918, 0.0823918, 0.0823918),
            (0.00036608, 0.00036608, 0.00036608),
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
        ],
    ),
    "no diffuse base": (
        GLASSY,
        [
            (0.637346, 0.380082, 0.122818),
            (0.373298, 0.26651, 0.159723),
            (0.0806486, 0.0712667, 0.0618847),
            (0.00462219, 0.00288853, 0.00115487),
            (0.244046, 0.181901, 0.0813486),
            (0.0581188, 0.0433192, 0.0193729),
            (0.0, 0.0, 0.0),
        ],
    ),
}
DENSITIES = {
    "sheet": (SHEET, [0.727732, 0.350671, 0.0697046, 0.0276829, 1.64879, 0.268121, 0.0114592]),
    "sheet of a low index": (
        LOW,
        [0.727732, 0.350671, 0.0697046, 0.0276829, 0.0852444, 0.0424832, 0.0114592],
    ),
}


def directions(which):
    """Unit vectors (3, n)."""
    z, turn = np.array([pair[which] for pair in PAIRS]).T
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z]).astype(F4)


def evaluated(bsdf, inside):
    wo, wi = directions(0), directions(1)
    n = wo.shape[1]
    up, lane = np.repeat(F4([[0], [0], [1]]), n, 1), np.zeros(n, np.intp)
    nowhere = np.zeros((3, n), F4)
    surface = SurfaceInteraction(nowhere, nowhere[0], up, up, wo, lane, lane, np.full(n, inside))
    f, pdf = bsdf.bind(surface).evaluate(wo, wi)
    return f * np.abs(wi[2]), pdf


@pytest.mark.parametrize("name", VALUES)
def test_values(name):
    bsdf, expected = VALUES[name]
    found = evaluated(bsdf, "inside" in name)[0].T
    assert found == pytest.approx(np.array(expected), rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("name", DENSITIES)
def test_densities_of_sheets(name):
    """Those of `Disney` differ: reflection and refraction share their facets here."""
    bsdf, expected = DENSITIES[name]
    for inside in (False, True):
        _, pdf = evaluated(bsdf, inside)
        assert pdf == pytest.approx(expected, rel=1e-5)
