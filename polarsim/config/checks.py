"""Checks of a configuration that concern several sections."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import ValidationError

from polarsim.acquire.options import NO_SEEDS, SeedOptions
from polarsim.config.sections import Sections
from polarsim.detect.options import VIEWS
from polarsim.errors import LabelError
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import PhotoKey, terrain_text
from polarsim.rover.cameras.options import PACKAGED_FILES
from polarsim.rover.perception.options import FINE_TUNED


def check_sections(config: Sections) -> None:
    """Raise a ValueError that begins with the key of the first value that does not fit the other sections."""
    _check_site(config)
    _check_scans(config)
    _check_rover(config)
    _check_folds(config)
    _check_mixes(config)
    _check_others(config)
    _check_components(config)


def _check_site(config: Sections) -> None:
    if wrong := next(_names_not_of_site(config), None):
        raise ValueError(wrong)


def _names_not_of_site(config: Sections) -> Iterator[str]:
    """Yield a message for each name that the site does not have."""
    site = config.site
    for number, terrain in enumerate(config.terrains):
        if terrain not in site.terrains:
            yield f"terrains.{number}: terrain {terrain}, expected {site.terrains_text}"
    for position in config.positions:
        if position not in site.all_positions:
            yield f"positions: position {position!r}, expected {', '.join(site.all_positions)}"
    for terrain in config.terrains:
        if not set(config.positions) & set(site.positions_of(terrain)):
            known = " or ".join(config.positions)
            yield f"positions: terrain {terrain_text(terrain)} has no position {known}"
    yield from (f"grid.{wrong}" for wrong in config.grid.wrong_values(site))
    if isinstance(seeds := config.labels.seeds, SeedOptions):
        yield from (f"labels.seeds.{wrong}" for wrong in seeds.wrong_values(site))
    for key in config.labels.excluded_annotations:
        try:
            site.key(key)
        except LabelError as error:
            yield f"labels.excluded_annotations: {error}"
    for terrain in config.labels.min_shadow_exposure_ms_by_terrain:
        if terrain not in site.terrains:
            yield f"labels.min_shadow_exposure_ms_by_terrain.{terrain}: expected terrain {site.terrains_text}"


def _check_scans(config: Sections) -> None:
    if config.labels.seeds == NO_SEEDS and not config.data_source.has_scans:
        raise ValueError(
            f"labels.seeds: {NO_SEEDS} requires scans for the localisation of cameras; source "
            f"{config.source.kind!r} has no scans"
        )
    if config.labels.seeds == NO_SEEDS and not config.has_scans:
        raise ValueError(
            f"labels.seeds: {NO_SEEDS} requires scans for the detection of rocks, expected source.scans: true and "
            "files.clouds or files.range_maps of the site"
        )


def _check_rover(config: Sections) -> None:
    if not config.rover.run:
        return
    for terrain in config.rover.world.terrains:
        if terrain not in config.terrains:
            raise ValueError(f"rover.world.terrains: {terrain}, expected {config.terrains_text}")
    if config.rover.detector is not None and config.rover.detector not in config.training_domains:
        known = ", ".join(config.training_domains) or "none: no detector is trained"
        raise ValueError(f"rover.detector: domain {config.rover.detector!r}, expected {known}")
    tuned = [FINE_TUNED] if config.rover.fine_tuning.drives else []
    known_detectors = [*PACKAGED_FILES, *tuned, *config.training_domains]
    if unknown := sorted(set(config.rover.autonomy.detectors) - set(known_detectors)):
        known = ", ".join(known_detectors)
        raise ValueError(f"rover.autonomy.detectors: {unknown[0]!r}, expected {known}")


def _check_folds(config: Sections) -> None:
    if not config.covers.run:
        return
    for fold in config.cover_folds:
        if unknown := sorted(set(fold) - set(config.terrains)):
            raise ValueError(f"covers.folds: {unknown[0]}, expected {config.terrains_text}")
        if not set(config.terrains) - set(fold):
            raise ValueError(f"covers.folds: {fold} contains all terrains, no terrain remains for training")
    for key in config.covers.keys:
        if PhotoKey.parse(key).terrain not in config.terrains:
            raise ValueError(f"covers.keys: {key}, expected {config.terrains_text}")


def _check_mixes(config: Sections) -> None:
    if not config.detect.run:
        return
    single = {*config.domains, *([VIEWS] if config.detect.views else [])}
    for name, weights in config.detect.mixes.items():
        if name in single | {VIEWS}:
            raise ValueError(f"detect.mixes: {name} is the name of a domain, expected another name")
        if unknown := sorted(set(weights) - single):
            raise ValueError(f"detect.mixes.{name}: domain {unknown[0]!r}, expected {', '.join(sorted(single))}")


def _check_others(config: Sections) -> None:
    for name, other in config.detect.others.items() if config.domains else ():
        if unknown := sorted(set(other.trained_on) - set(config.training_domains)):
            known = ", ".join(config.training_domains)
            raise ValueError(f"detect.others.{name}.trained_on: {unknown[0]!r}, expected {known}")


def _check_components(config: Sections) -> None:
    if not config.gap.components:
        return
    if not config.domains:
        raise ValueError("gap.components: the run has no twins to compare with photos")
    for name, component in config.gap.components.items():
        if component.needs_truth and not config.data_source.is_generated:
            raise ValueError(f"gap.components.{name}: the source {config.source.kind!r} has no ground truth")
        as_run = component.materials == "run" and config.render.materials_from_photos
        if (as_run or component.materials == "fitted") and component.meshes != "run":
            raise ValueError(f"gap.components.{name}: fitted materials require the meshes of the run (meshes: run)")
        try:
            config.render_options_of(name)
        except ValidationError as error:
            raise ValueError(f"gap.components.{name}.render.{describe_error(error, 'render')}") from error
