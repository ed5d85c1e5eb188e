"""Data sources by name."""

from __future__ import annotations

from polarsim.sources.analog import AnalogSource
from polarsim.sources.files import FilesSource
from polarsim.sources.release import ReleaseSource
from polarsim.sources.source import DataSource

SOURCES: dict[str, DataSource] = {"analog": AnalogSource(), "release": ReleaseSource(), "files": FilesSource()}
