"""Labels of one position of the tripod, for any camera and lamp."""

from __future__ import annotations

from polarsim.geometry.boxes import area
from polarsim.labels.known import Known
from polarsim.labels.label import Label
from polarsim.labels.lit import hidden_by_dark
from polarsim.labels.options import LabelsOptions
from polarsim.labels.photos import Brightness, Photos
from polarsim.labels.position_rocks import PositionRocks
from polarsim.labels.position_shadows import PositionShadows
from polarsim.labels.shadows import lamp
from polarsim.photo import Azimuth, CameraSide, Light


class PositionLabels:
    """Labels of one position; without photos as people draw them, with photos as these show things."""

    def __init__(self, known: Known, position: str, options: LabelsOptions, photos: Photos | None = None) -> None:
        self.position, self.photos, self.options = position, photos, options
        self.rocks = PositionRocks(known, position, options)
        self.shadows = PositionShadows(self.rocks, options)
        self._known: dict[tuple[CameraSide, Light, Azimuth], list[Label]] = {}

    def labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        """What the photos of a camera under a lamp show, longest exposure.

        Where there are photos to tell what is seen, also what was not annotated: people forget, and draw by azimuth.
        """
        lamps: tuple[CameraSide, Light, Azimuth] = (camera, light if azimuth == "no" else "off", azimuth)
        if lamps not in self._known:  # a Sun lamp outshines the rover light
            self._known[lamps] = self._labels(camera, light, azimuth)
        return self._known[lamps]

    def _labels(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> list[Label]:
        brightness = self._brightness(camera, light, azimuth)
        labels = self.rocks.labels(camera, azimuth)
        if self.options.visibility == "annotator" and azimuth not in self.rocks.azimuths:
            labels = [label for label in labels if not self._hidden_by_dark(label.rock, azimuth)]
        if brightness is not None:
            labels += self.rocks.unannotated(camera, labels)
        if lamp(self.rocks.world, self.rocks.placed, light, azimuth) is not None:
            labels += self.shadows.labels(camera, light, azimuth, labels, brightness)
        return [label for label in labels if area(label.box) > 0]

    def _hidden_by_dark(self, rock: int, azimuth: Azimuth) -> bool:
        return hidden_by_dark(self.rocks.world, rock, azimuth, self.rocks.annotated_azimuths(rock))

    def _brightness(self, camera: CameraSide, light: Light, azimuth: Azimuth) -> Brightness | None:
        """What photos show under a Sun lamp: without rover light where there are such, for it brightens shadows."""
        if self.photos is None:
            return None
        lights: tuple[Light, ...] = (light,) if azimuth == "no" else ("off", "on")
        sets = (self.photos.brightness((self.position, camera, own, azimuth)) for own in lights)
        return next((brightness for brightness in sets if brightness is not None), None)
