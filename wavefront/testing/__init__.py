"""Checks of BSDFs, lights, phase functions, warps and pictures, for users and for the tests.

Examples
--------
>>> report = wf.testing.check_bsdf(wf.Diffuse(0.5), samples=20_000)
>>> all(check.passed for check in report.checks.values())
True
"""

from .bsdf import check_bsdf
from .light import check_light
from .phase import check_phase
from .picture import assert_same_picture
from .report import Check, Report
from .warp import check_warp

__all__ = ["Check", "Report", "assert_same_picture", "check_bsdf", "check_light", "check_phase", "check_warp"]
