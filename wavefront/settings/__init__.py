"""The settings of a render: their declaration, their checks, and which of them go together."""

from .checks import AUTO, refuse, whole_number
from .declaration import SETTINGS, RenderSettings, describes_settings, takes_settings
from .settings import DEFAULT_SPP, Settings

__all__ = [
    "AUTO",
    "DEFAULT_SPP",
    "SETTINGS",
    "RenderSettings",
    "Settings",
    "describes_settings",
    "refuse",
    "takes_settings",
    "whole_number",
]
