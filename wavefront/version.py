"""The version, in one place, and without the time it takes to read it from the package's metadata."""

VERSION = "0.1.0"
