"""Publish a run: choose, count, look for space, write each form, say what came out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from polarsim import __version__
from polarsim.digest import code_digest
from polarsim.errors import ConfigError
from polarsim.formats.files import write_json
from polarsim.progress import share_bar
from polarsim.publish import (
    crate,
    croissant,
    detection_sets,
    huggingface,
    pds4,
    reconstruction,
    ros_bags,
    scenes,
    stereo_set,
    trajectories,
    weights,
)
from polarsim.publish.bundle import Bundle, check_space
from polarsim.publish.card import write_card
from polarsim.publish.catalogue import Catalogue, Picture, read_catalogue
from polarsim.publish.options import PublishOptions
from polarsim.publish.subset import chosen, fitting, parse_size, parse_subset

NO_PART = "in no part"  # of the note on pictures that are left out
ALL = "all"  # stands for all forms that a run can have
Write = Callable[[Catalogue, Bundle], None]


def no_picture(_: Picture) -> int:
    """Bytes of a picture in a form that takes none along."""
    return 0


@dataclass(frozen=True)
class Form:
    """A form in which a run leaves."""

    says: str  # what is in its folder, for the data card
    write: Write
    bytes_of: Callable[[Picture], int]  # about, of one picture
    needs: tuple[str, ...] = ()  # packages that it imports beyond the core's
    front: Callable[[Catalogue], str] = lambda _: ""  # what stands before the card
    fixed: Callable[[Catalogue], int] = lambda _: 0  # bytes, about, of what is no picture of a station
    lacks: Callable[[Catalogue], str] = lambda _: ""  # why the run cannot have the form
    by_part: bool = False  # pictures in no part of the run's split are left out


def _mesh_bytes(catalogue: Catalogue) -> int:
    return sum(path.stat().st_size for one in catalogue.terrains.values() for path in one.meshes.values())


def _no_mesh(catalogue: Catalogue) -> str:
    return "" if any(one.meshes for one in catalogue.terrains.values()) else "the run has no meshes"


def _no_drive(catalogue: Catalogue) -> str:
    return "" if catalogue.drives else "the run has no drive (rover.run in its configuration)"


FORMS: dict[str, Form] = {
    "croissant": Form(
        f"`{croissant.FILE}` describes tables (Parquet) and pictures (16-bit PNG below `pictures/<domain>/`) in "
        "Croissant 1.1 with RAI fields, `geocroissant.json` with the frame too. "
        "Read the tables with `mlcroissant`, the pictures by file.",
        croissant.write, croissant.bytes_of, croissant.NEEDS,
    ),
    "hf": Form(
        "A folder for Hugging Face's `datasets`: a configuration a domain, `<domain>/<split>/KEY.png` with 16 bits, "
        "`ids/KEY.png` (1000 + k: rock k, 2000 + k: its shadow; 65534, 65535: of a rock without a number), and "
        "`metadata.parquet` with key, pose, lens and objects (bbox x y w h, category 0 rock 1 shadow, masks as COCO "
        "runs). `load_dataset(FOLDER, DOMAIN)` reads it.",
        huggingface.write_folder, huggingface.bytes_of, front=lambda one: huggingface.front(one, parquet=False),
        by_part=True,
    ),
    "parquet": Form(
        "The same as `hf` in Parquet files that hold the pictures' own bytes: `load_dataset(FOLDER, DOMAIN)`.",
        huggingface.write_parquet, huggingface.bytes_of, front=lambda one: huggingface.front(one, parquet=True),
        by_part=True,
    ),
    "coco": Form(
        "`images/<domain>/KEY.png` with 16 bits and `annotations/<domain>_<part>.json`: boxes, visible masks as runs "
        "and, of twins, amodal masks (`amodal_segmentation`, `amodal_bbox`, `visible_share`); a shadow names the "
        "annotation of its rock in `shadow_of`. `pycocotools` reads it.",
        detection_sets.write_coco, detection_sets.coco_bytes, by_part=True,
    ),
    "yolo": Form(
        "A data set a domain for YOLO trainers: `<domain>.yaml`, `<domain>/images/<part>/KEY.png` with 8 bits (by the "
        "curve that the run's own detectors are trained with, `detect.pictures`), `<domain>/labels/<part>/KEY.txt` "
        "(0 rock, 1 shadow).",
        detection_sets.write_yolo, detection_sets.yolo_bytes, by_part=True,
    ),
    "kitti": Form(
        "A data set a domain as KITTI's devkit expects it: rectified pairs (8 bits, `training/image_2` left, "
        "`image_3` right), `calib`, `label_2` (Rock, Shadow; boxes in three dimensions are not known), `disp_noc_0` "
        "and `disp_occ_0` (disparity of the meshes, 256 a pixel; 0 where there is none or where it is 256 px and "
        "more), `ImageSets`, and `keys.csv`, which names the photo keys. In `calib` the laser's frame is the sandbox.",
        stereo_set.write, stereo_set.bytes_of, by_part=True,
    ),
    "colmap": Form(
        "A COLMAP model a domain and terrain: `images/KEY.png` (8 bits), `sparse/0/*.txt` with lenses, the rig, poses "
        "in the sandbox frame, and points drawn over the meshes. The light changes from picture to picture: "
        "`--subset azimuth=180,light=off` gives one light.",
        reconstruction.write_colmap, reconstruction.bytes_of,
    ),
    "nerfstudio": Form(
        "A folder a domain and terrain for nerfstudio and its splats: `images/KEY.png` (8 bits), `transforms.json`, "
        "`points.ply` drawn over the meshes. `--subset azimuth=180,light=off` gives one light.",
        reconstruction.write_nerfstudio, reconstruction.bytes_of,
    ),
    "pds4": Form(
        "A PDS4 bundle, `bundle.xml`: collections of pictures (`data_<domain>`) and of maps of ids (`ids_<domain>`) as "
        "raw arrays, of browse pictures, tables, maps and documents; a label beside every file states types, units, "
        "frames, and whether values were measured, fitted or are synthetic. `pds4_tools` reads it. It was not "
        "validated by the PDS.",
        pds4.write, pds4.bytes_of,
    ),
    "ro-crate": Form(
        f"An RO-Crate, `{crate.FILE}`: pictures, what made each twin, tables, meshes, poses, the workflow's files, and "
        "the run as the action that made them. `rocrate` reads it.",
        crate.write, crate.bytes_of, crate.NEEDS, fixed=_mesh_bytes,
    ),
    "gltf": Form(
        "`terrainNN.glb`: ground and rocks as named nodes with rock ids (`extras`), cameras (principal point and "
        "distortion in `extras`) and lamps; metres, +Y up. No pictures.",
        scenes.write_gltf, no_picture, fixed=_mesh_bytes, lacks=_no_mesh,
    ),
    "usd": Form(
        "`terrainNN.usdc`: ground and rocks with semantic labels (`class`, `rock_id`), cameras with apertures, "
        "principal point and distortion (`polarsim:*`), lamps; metres, +Z up. No pictures.",
        scenes.write_usd, no_picture, scenes.USD_NEEDS, fixed=_mesh_bytes, lacks=_no_mesh,
    ),
    "mcap": Form(
        "Bags for ROS 2, each a folder with `metadata.yaml`: `drives/seedN` as the rover's run wrote them, and "
        "`stations/<domain>/TerrainNN_PosX` with pictures (16-bit PNG), camera_info, labels and keys of both cameras, "
        "a second apart, for NASA noted no times.",
        ros_bags.write, ros_bags.bytes_of, ros_bags.NEEDS, fixed=ros_bags.fixed_bytes,
    ),
    "euroc": Form(
        "The rover's drives as EuRoC's `mav0` folders: pictures of cameras that are fixed to the rover, an IMU without "
        "noise, exact states. Everything is synthetic.",
        trajectories.write_euroc, no_picture, fixed=trajectories.fixed_bytes, lacks=_no_drive,
    ),
    "tum": Form(
        "The rover's drives as TUM's folders: `rgb/`, `rgb.txt` and `groundtruth.txt`, poses of the camera in the "
        "world. Everything is synthetic.",
        trajectories.write_tum, no_picture, fixed=trajectories.fixed_bytes, lacks=_no_drive,
    ),
    "detectors": Form(
        "The run's detectors: `<split>/seedN/<domain>.pt`, tensors and plain values in PyTorch's format, and beside "
        "each `<domain>.md`, a card with its training and its scores. `polarsim detect --weights` uses them.",
        weights.write, no_picture, fixed=weights.fixed_bytes, lacks=weights.lacking,
    ),
}  # fmt: skip


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
    lacking = {name: FORMS[name].lacks(catalogue) for name in FORMS}
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
        write_card(catalogue, bundle, name, form.says, form.front(catalogue))
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
