"""Exit statuses."""

from __future__ import annotations

FAULT = 1  # `doctor` found one
ERROR = 2  # as argparse has it
HUNG_UP = 129  # 128 + SIGHUP
INTERRUPTED = 130  # 128 + SIGINT, as shells report it
TERMINATED = 143  # 128 + SIGTERM
