"""Publish a run: choose, count, look for space, write each form, say what came out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from polarsim import __version__
from polarsim.digest import code_digest
from polarsim.errors import ConfigError
from polarsim.formats.files import write_json
from polarsim.progress import share_bar
from polarsim.publish.bundle import Bundle, check_space
from polarsim.publish.card import write_card
from polarsim.publish.catalogue import Catalogue, read_catalogue
from polarsim.publish.forms import FORMS, Form, no_picture
from polarsim.publish.options import PublishOptions
from polarsim.publish.subset import chosen, fitting, parse_size, parse_subset

NO_PART = "in no part"  # of the note on pictures that are left out
ALL = "all"  # stands for all forms that a run can have


def publish(
    run: Path,
    out: Path,
    forms: Sequence[str],
    subset: str = "",
    max_size: str = "",
    photos: bool = False,
    replace: bool = False,
    split: str = "",
) -> dict[str, Catalogue]:
    """Write `out/<form>/` for every form; what each holds.

    Parameters
    ----------
    run
        Its folder, `results/<run>`.
    forms
        Names in `FORMS`, or `all`.
    subset
        As `subset.parse_subset` reads it.
    max_size
        Largest size of each form, as `subset.parse_size` reads it; none where it is empty.
    photos
        Whether NASA's photos go out too: their terms are NASA's. Those of the analog always go.
    replace
        Whether what another call published in the folder of a form goes.
    split
        Name of the split whose parts pictures have; the run's first one where it is empty.

    Raises
    ------
    ConfigError
        An unknown form or one that the run cannot have, a package that is missing, a subset without pictures, a
        folder that holds something else.
    FormatError
        A broken file of the run.
    PolarsimError
        Too little space.
    """
    for name in FORMS if ALL in forms else forms:
        _check(name)
    catalogue = chosen(_allowed(read_catalogue(run, split), photos), parse_subset(subset))
    most = parse_size(max_size) if max_size else None
    names = _possible(catalogue, forms)
    parts = {name: _cut(_assigned(catalogue, FORMS[name]), FORMS[name], most) for name in names}
    check_space(out, sum(_size(one, FORMS[name]) for name, one in parts.items()))
    for name, one in parts.items():
        recipe = {"form": name, "run": one.name, "config": one.config, "subset": subset, "max_size": max_size}
        recipe |= {"split": one.split}
        _write(
            name, one, out / name, recipe | {"photos": photos, "polarsim": __version__, "code": _code(name)}, replace
        )
    return parts


def publish_run(*, form: str, receipt: Path, options: PublishOptions, split: str = "") -> None:
    """Publish the run that `receipt` lies in, as `publish/<form>/` beside it, and write what came out into it."""
    part = publish(
        receipt.parents[1],
        receipt.parent,
        [form],
        options.subset,
        options.max_size,
        options.photos,
        replace=True,
        split=split,
    )[form]
    counts = {domain: len(part.of_domain(domain)) for domain in part.domains}
    own = {"form": form, "pictures": counts, "split": part.split}
    write_json(receipt, own | options.model_dump(mode="json", exclude={"forms"}))


def _code(name: str) -> str:
    """Digest of what writes the form: files of other code are not taken for those of this one."""
    return code_digest("polarsim.publish.card", FORMS[name].write.__module__)


def _possible(catalogue: Catalogue, forms: Sequence[str]) -> list[str]:
    """The forms, without doubles; of all those that the run can have."""
    lacking = {name: FORMS[name].unavailable(catalogue) for name in FORMS}
    if ALL in forms:
        return [name for name in FORMS if not lacking[name]]
    for name in forms:
        if lacking[name]:
            raise ConfigError(f"format {name}: {lacking[name]}", path=catalogue.run)
    return list(dict.fromkeys(forms))


def _check(name: str) -> None:
    if name not in FORMS:
        raise ConfigError(f"format {name!r}, expected {', '.join(FORMS)}")
    form = FORMS[name]
    for package in form.needs:
        if find_spec(package) is None:
            raise ConfigError(f"format {name} needs {package}: pip install 'polarsim[publish]'")


def _allowed(catalogue: Catalogue, photos: bool) -> Catalogue:
    """Without NASA's photos unless they are asked for."""
    if photos or "real" not in catalogue.domains:
        return catalogue
    kept = [one for one in catalogue.pictures if one.domain != "real"]
    if not kept:
        raise ConfigError("nothing but NASA's photos: --photos publishes them, on NASA's terms", path=catalogue.run)
    return catalogue.with_pictures(kept, "NASA's photos are not in this bundle: get them from NASA; keys name them.")


def summary(form: str, part: Catalogue, folder: Path) -> str:
    """What came out, for the terminal."""
    what = form if FORMS[form].bytes_of is no_picture else f"{len(part.pictures)} pictures"
    return "\n".join([f"{what} in {folder}", *(note for note in part.left_out if NO_PART in note)])


def _assigned(catalogue: Catalogue, form: Form) -> Catalogue:
    """Without pictures in no part, for forms with a folder or file a part; all of them where no split was drawn.

    Raises
    ------
    ConfigError
        The split has no picture.
    """
    if not form.by_part or not catalogue.split:
        return catalogue
    kept = [one for one in catalogue.pictures if one.part]
    if not kept:
        raise ConfigError(f"no picture is in a part of split {catalogue.split!r}", path=catalogue.run)
    without = len(catalogue.pictures) - len(kept)
    if not without:
        return catalogue
    of_all = f"{without} of {len(catalogue.pictures)} pictures"
    return catalogue.with_pictures(kept, f"{of_all} are {NO_PART} of the split by {catalogue.split}: left out.")


def _cut(catalogue: Catalogue, form: Form, most: int | None) -> Catalogue:
    return fitting(catalogue, form.bytes_of, _FIXED + form.fixed(catalogue), most) if most else catalogue


_FIXED = 10**6  # bytes of cards, receipts and the heads of tables


def _size(catalogue: Catalogue, form: Form) -> int:
    return _FIXED + form.fixed(catalogue) + sum(map(form.bytes_of, catalogue.pictures))


def _write(name: str, catalogue: Catalogue, folder: Path, recipe: dict[str, Any], replace: bool) -> None:
    form = FORMS[name]
    with _counting(name, len(catalogue.pictures)) as done:
        bundle = Bundle(folder, done)
        bundle.open(recipe, replace)
        form.write(catalogue, bundle)
        write_card(catalogue, bundle, name, form.description, form.front(catalogue))
        bundle.close()


@contextmanager
def _counting(text: str, pictures: int) -> Iterator[Callable[[], None]]:
    """A bar over files; how many there will be is known about, so the last percent may take a while."""
    with share_bar(text) as tell:
        made = 0

        def done() -> None:
            nonlocal made
            made += 1
            tell(min(0.99, made / max(1, pictures)))

        yield done
        tell(1.0)
