"""Surfaces that show only the shadows on them."""

from __future__ import annotations

from .diffuse import Diffuse


class ShadowCatcher(Diffuse):
    """A shadow catcher: the camera sees only the shadows on it. For objects composed onto photographs.

    Where it is in full light, the camera sees the background through it; where all light is blocked it is
    black and opaque. Its opacity is 1 − the ratio of the light that arrives to the light that would arrive if
    nothing were in the way, as in the shadow matte of Arnold and the shadow catcher of Blender's Cycles.
    Only direct light counts, by its luminance, so the shadow has no color. To rays that have been scattered,
    such as those of mirrors and of the indirect light on objects, it is a `Diffuse` surface.

    Parameters
    ----------
    reflectance
        As for `Diffuse`; for the light that it reflects onto objects.

    Notes
    -----
    For each sample of the camera one of 16 candidates of arriving light is chosen by its part of their sum
    (resampled importance sampling, J. Talbot et al. 2005), and one shadow ray is traced to it. With one
    point or directional light the opacity has no bias; in other light its bias falls with the number of
    candidates.

    Examples
    --------
    >>> ground = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.ShadowCatcher())
    >>> ball, sun = wf.Sphere((0, 1, 0), 1), wf.DirectionalLight((1, -2, -1), 3)
    >>> image = wf.render([ground, ball, sun], spp=1, size=(16, 16), background="transparent")
    >>> image.alpha.shape
    (16, 16)
    """

    catches_shadows = True
