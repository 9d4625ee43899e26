"""Scattering models. Adding one is a file here and a line below; the parametrized tests find it there."""

from .base import Bsdf, BsdfSample, albedo_of, evaluated, sampled
from .conductor import Conductor
from .dielectric import Dielectric
from .diffuse import Diffuse
from .diffuse_transmission import DiffuseTransmission
from .disney import Disney
from .disney_thin import ThinDisney
from .measured import Measured
from .mirror import Mirror
from .mix import Mix
from .null import NullSurface
from .openpbr import OpenPBRBsdf
from .oren_nayar import OrenNayar
from .plastic import Plastic
from .principled import Principled
from .shadow_catcher import ShadowCatcher
from .sides import Sides
from .thin import ThinDielectric

# all that need no file
ALL = (
    Diffuse,
    Mirror,
    Dielectric,
    Conductor,
    DiffuseTransmission,
    OrenNayar,
    ThinDielectric,
    Plastic,
    Principled,
    OpenPBRBsdf,
    Disney,
    ThinDisney,
    Mix,
    Sides,
)

__all__ = [
    "ALL",
    "Bsdf",
    "BsdfSample",
    "Conductor",
    "Dielectric",
    "Diffuse",
    "DiffuseTransmission",
    "Disney",
    "Measured",
    "Mirror",
    "Mix",
    "NullSurface",
    "OpenPBRBsdf",
    "OrenNayar",
    "Plastic",
    "Principled",
    "ShadowCatcher",
    "Sides",
    "ThinDielectric",
    "ThinDisney",
    "albedo_of",
    "evaluated",
    "sampled",
]
