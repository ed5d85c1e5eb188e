"""Results page of a run that is not complete: progress, images of the first terrain, and the figures so far.

The page has the name of the results page, which replaces it. The modification time is in 1970, so that Snakemake does
not mistake the page of an interrupted run for the results page.
"""

from __future__ import annotations

import logging
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from threading import Thread

import jinja2

from polarsim.errors import PolarsimError
from polarsim.formats.files import read_json, relative_to, writing
from polarsim.paths import RunPaths
from polarsim.photo import PhotoKey
from polarsim.progress import about
from polarsim.running.stages import RunProgress

RULE = "write_results_page"
MODIFIED_S = 1  # modification time of the page; Snakemake ignores 0
_TEMPLATE = Path(__file__).with_name("first_page.html.jinja")
_MARK = b"<!doctype html><!-- incomplete run -->"  # first line of the template
_PANEL = 640  # width of images, px
_USUAL_STOPS = 0.5  # maximum difference of a usual exposure
_LOG = logging.getLogger(__name__)


def is_first_page(page: Path) -> bool:
    """Return whether a file is the page of an incomplete run."""
    try:
        with page.open("rb") as file:
            return file.read(len(_MARK)) == _MARK
    except OSError:
        return False


class FirstPage:
    """Page of the run `paths.run` in the working folder until the results page is written."""

    def __init__(self, paths: RunPaths) -> None:
        self._paths, self._results = paths, Path("results") / paths.run
        self.page = self._results / "results.html"
        self._template = jinja2.Template(_TEMPLATE.read_text(encoding="utf-8"), autoescape=True)
        self._panels: tuple[str, list[tuple[str, str]]] = ("", [])
        self._drawing: Thread | None = None
        self._written: object = None

    def update(self, progress: RunProgress) -> None:
        """Write the page if the run writes a results page later, a terrain has images, and the progress has changed."""
        if progress.planned[RULE] and not any(job.rule == RULE for job in progress.jobs):
            self._draw(progress)
            self._write(progress, is_running=True)

    def stop(self, progress: RunProgress) -> None:
        """Write the state at the end of an incomplete run into the page."""
        if self._drawing:
            self._drawing.join()
        if is_first_page(self.page):
            self._write(progress, is_running=False)

    def _draw(self, progress: RunProgress) -> None:
        """Draw the images of the first terrain with labels and a twin in a thread."""
        if self._drawing:
            return
        unfinished = {path for job in progress.jobs if not job.finished for path in job.outputs}

        def is_complete(path: Path) -> bool:
            return path.exists() and path.as_posix() not in unfinished

        for terrain in self._paths.terrains:
            twins = self._twins(terrain)
            if is_complete(self._labels(terrain)) and (is_complete(twins) or self._shows_sun(twins)):
                self._drawing = Thread(target=self._draw_panels, args=(terrain,), daemon=True)
                self._drawing.start()
                return

    def _labels(self, terrain: str) -> Path:
        return self._results / f"labels/tables/Terrain{terrain}.parquet"

    def _twins(self, terrain: str) -> Path:
        return self._results / f"renders/{self._paths.models[-1]}/Terrain{terrain}"

    def _shows_sun(self, twins: Path) -> bool:
        """Return whether a folder, which may be incomplete, has a twin under the Sun with about the usual exposure."""
        keys = (PhotoKey.parse(path.stem) for path in twins.glob("[!.]*.png"))
        usual_ms = self._paths.config.site.usual_exposure_ms
        return any(key.has_sun and key.light == "off" and key.stops_from(usual_ms) < _USUAL_STOPS for key in keys)

    def _draw_panels(self, terrain: str) -> None:
        from polarsim.formats import thumbnails
        from polarsim.report.figures.strip import draw_strip
        from polarsim.run_files.pictures import STRIP_TEXT

        try:
            with tempfile.TemporaryDirectory() as folder:
                strip = Path(folder) / "strip"
                draw_strip(
                    site=self._paths.config.site,
                    photos=self._results / f"acquire/Terrain{terrain}/photos.parquet",
                    twins=self._twins(terrain),
                    labels=self._labels(terrain),
                    predictions=None,
                    model=self._paths.models[-1],
                    trained="",
                    strip=strip,
                )
                content = read_json(strip / STRIP_TEXT)
                images = [
                    (thumbnails.of_picture(strip / f"{name}.png", _PANEL), text) for name, text in content["panels"]
                ]
                self._panels = content["key"], images
        except (PolarsimError, OSError) as error:  # the run goes on without the images
            _LOG.warning("no images on the first page: %s", error)

    def _write(self, progress: RunProgress, *, is_running: bool) -> None:
        key, panels = self._panels
        links = self._links()
        left = about(progress.left_s)
        content = (is_running, left, sum(job.finished for job in progress.jobs), len(panels), len(links))
        if not panels or content == self._written or (self.page.exists() and not is_first_page(self.page)):
            return
        text = self._template.render(
            run=self._paths.run,
            source=self._paths.origin["source"],
            left=left,
            is_running=is_running,
            stages=progress.stages(),
            key=key,
            panels=panels,
            links=links,
        )
        try:
            with writing(self.page) as temporary:
                temporary.write_text(text, encoding="utf-8")
                os.utime(temporary, (MODIFIED_S, MODIFIED_S))
            self._written = content
        except PolarsimError as error:
            _LOG.warning("%s", error)

    def _links(self) -> list[str]:
        """Return the links of the existing figures, in the order of their creation."""
        found = {}
        for path in self._results.glob("figures/[!.]*.png"):
            with suppress(OSError):  # a job replaces the figure
                found[path] = path.stat().st_mtime
        return [relative_to(path, self._results) for path in sorted(found, key=found.__getitem__)]
