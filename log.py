"""The logger "rebound". In background its lines go to the console, because nobody else would show them."""

import logging
import sys

import bpy

LOGGER = logging.getLogger("rebound")


class _ConsoleHandler(logging.StreamHandler):
    """Writes to what sys.stdout is now, not to what it was when the extension was enabled (tests capture it)."""

    def __init__(self) -> None:
        super().__init__(sys.stdout)
        self.setFormatter(logging.Formatter("rebound: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        self.stream = sys.stdout
        super().emit(record)


def register() -> None:
    if bpy.app.background:
        LOGGER.setLevel(logging.INFO)
        LOGGER.addHandler(_ConsoleHandler())


def unregister() -> None:
    for handler in [h for h in LOGGER.handlers if isinstance(h, _ConsoleHandler)]:
        LOGGER.removeHandler(handler)
