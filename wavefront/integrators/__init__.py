"""Estimators of light, the steps that they are made of, and how their settings are tuned."""

from .ladder import *
