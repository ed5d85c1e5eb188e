"""Publish a run: select images, check the disk space, write each format."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from polarsim import __version__
from polarsim.digest import code_digest
from polarsim.errors import ConfigError
from polarsim.extras import require
from polarsim.formats.files import write_json
from polarsim.progress import progress_bar
from polarsim.publish import terms
from polarsim.publish.bundle import Bundle, check_space
from polarsim.publish.card import write_card
from polarsim.publish.catalogue import Catalogue
from polarsim.publish.catalogue_reader import read_catalogue
from polarsim.publish.forms import FORMS, NO_IMAGES, Form
from polarsim.publish.options import PublishOptions
from polarsim.publish.subset import limit_size, parse_size, parse_subset, select

NO_PART = "in no part"  # phrase in the note on excluded images
ALL = "all"  # all formats that are available for a run


def publish_forms(
    run: Path,
    out: Path,
    forms: Sequence[str],
    subset: str = "",
    max_size: str = "",
    photos: bool = False,
    replace: bool = False,
    split: str = "",
) -> dict[str, Catalogue]:
    """Write `out/<form>/` for every format in `forms` (or `all`); return the published part of the catalogue by format.

    `subset`, `max_size` and `photos` are `PublishOptions`. `replace` overwrites an export with other arguments. `split`
    determines the parts of images; empty for the run's first split.
    """
    for name in FORMS if ALL in forms else forms:
        _check(name)
    catalogue = select(_without_photos(read_catalogue(run, split), photos), parse_subset(subset))
    parts, need = {}, 0
    for name in _available(catalogue, forms):
        form = FORMS[name]
        part = _with_part(catalogue, form)
        others = _other_size(part, form)
        parts[name] = limit_size(part, form.image.of, others, parse_size(max_size)) if max_size else part
        need += others + sum(map(form.image.of, parts[name].pictures))
    check_space(out, need)
    for name, part in parts.items():
        # An export by other code is not resumed.
        code = code_digest("polarsim.publish.card", FORMS[name].write.__module__)
        recipe: dict[str, Any] = {"form": name, "run": part.name, "config": part.config, "subset": subset}
        recipe |= {"max_size": max_size, "split": part.split, "photos": photos}
        recipe |= {"polarsim": __version__, "code": code}
        _write(name, part, out / name, recipe, replace)
    return parts


def publish_run(*, form: str, receipt: Path, options: PublishOptions, split: str = "") -> None:
    """Publish the run that contains `receipt` to `publish/<form>/`, and write a summary to `receipt`."""
    run, out = receipt.parents[1], receipt.parent
    part = publish_forms(run, out, [form], options.subset, options.max_size, options.photos, True, split)[form]
    counts = {domain: len(part.of_domain(domain)) for domain in part.domains}
    content = {"form": form, "pictures": counts, "split": part.split}
    write_json(receipt, content | options.model_dump(mode="json", exclude={"forms"}))


def _available(catalogue: Catalogue, forms: Sequence[str]) -> list[str]:
    """Return the formats without duplicates; for `all`, the formats that are available for the run."""
    reasons = {name: FORMS[name].unavailable(catalogue) for name in FORMS}
    if ALL in forms:
        return [name for name in FORMS if not reasons[name]]
    for name in forms:
        if reasons[name]:
            raise ConfigError(f"format {name}: {reasons[name]}", path=catalogue.run)
    return list(dict.fromkeys(forms))


def _check(name: str) -> None:
    if name not in FORMS:
        raise ConfigError(f"format {name!r}, expected one of {', '.join(FORMS)}")
    require(*FORMS[name].needs)


def _without_photos(catalogue: Catalogue, photos: bool) -> Catalogue:
    """Exclude the photos of the site unless `photos` is set; photos of the analog are always included."""
    if photos or "real" not in catalogue.domains:
        return catalogue
    kept = [picture for picture in catalogue.pictures if picture.domain != "real"]
    if not kept:
        raise ConfigError(
            f"all images are photos of {catalogue.site.data_set}: use --photos to include them, under the terms of "
            "their owner",
            path=catalogue.run,
        )
    return catalogue.with_pictures(kept, terms.photos_left_out(catalogue))


def form_summary(form: str, part: Catalogue, folder: Path) -> str:
    """Return the lines that the command prints for a format."""
    content = form if FORMS[form].image == NO_IMAGES else f"{len(part.pictures)} images"
    return "\n".join([f"{content} in {folder}", *(note for note in part.left_out if NO_PART in note)])


def _with_part(catalogue: Catalogue, form: Form) -> Catalogue:
    """Exclude images in no part of the split, for formats with a folder or file per part."""
    if not form.by_part or not catalogue.split:
        return catalogue
    kept = [picture for picture in catalogue.pictures if picture.part]
    if not kept:
        raise ConfigError(f"no image is in a part of split {catalogue.split!r}", path=catalogue.run)
    excluded = len(catalogue.pictures) - len(kept)
    if not excluded:
        return catalogue
    of_all = f"{excluded} of {len(catalogue.pictures)} images"
    return catalogue.with_pictures(kept, f"{of_all} are {NO_PART} of the split by {catalogue.split} and excluded.")


def _other_size(catalogue: Catalogue, form: Form) -> int:
    """Return the size of cards, receipts, table headers and files that are no images, bytes."""
    return 10**6 + sum(path.stat().st_size for path in form.files(catalogue))


def _write(name: str, catalogue: Catalogue, folder: Path, recipe: dict[str, Any], replace: bool) -> None:
    form = FORMS[name]
    with _file_progress(name, len(catalogue.pictures)) as on_file:
        bundle = Bundle(folder, on_file)
        bundle.open(recipe, replace)
        form.write(catalogue, bundle)
        write_card(catalogue, bundle, name, form.description, form.front(catalogue))
        bundle.close()


@contextmanager
def _file_progress(text: str, pictures: int) -> Iterator[Callable[[], None]]:
    """Show a progress bar of files and their checksums; the number of files is estimated by the number of images."""
    with progress_bar(text) as update:
        files = 0

        def on_file() -> None:
            nonlocal files
            files += 1
            update(min(0.99, files / max(1, 2 * pictures)))

        yield on_file
        update(1.0)
