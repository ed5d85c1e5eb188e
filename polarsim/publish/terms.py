"""What is true of every run that is published: names, licences, citation, known faults."""

from __future__ import annotations

from polarsim.publish.catalogue import Catalogue

CC0 = "https://creativecommons.org/publicdomain/zero/1.0/"
NASA_TERMS = "https://www.nasa.gov/nasa-brand-center/images-and-media/"
URL = "https://github.com/uwsbel/POLAR-Sim"  # where the labels and meshes that a run starts from are published
CREATOR = "The polarsim developers"
LICENCES = (
    ("Labels, masks, poses, lamps, meshes, tables", "CC0 1.0", CC0),
    ("Twins, pictures of the analog, drives", "CC0 1.0 (polarsim claims no rights in what it makes)", CC0),
    (
        "Photos of NASA's POLAR data set (domain real)",
        "NASA's terms; not CC0, name NASA Ames as the source",
        NASA_TERMS,
    ),
)
CITATION = """\
@misc{polarsim,
  title = {polarsim: digital twins of NASA's POLAR photos},
  author = {{The polarsim developers}}
}
@misc{polar,
  title = {POLAR Stereo Dataset (Polar Optical Lunar Analog Reconstruction)},
  author = {Wong, Uland and Nefian, Ara and Edwards, Larry and Bouyssounouse, Xavier and Furlong, P. Michael
    and Deans, Matt and Fong, Terry},
  year = {2017},
  publisher = {NASA Ames Research Center}
}
@article{polarsim_paper,
  title = {POLAR-Sim: Augmenting NASA's POLAR Dataset for Data-Driven Lunar Perception and Rover Simulation},
  author = {Chen, Bo-Hsun and Negrut, Peter and Liang, Thomas and Batagoda, Nevindu and Zhang, Harry and Negrut, Dan},
  year = {2025},
  journal = {IEEE Transactions on Aerospace and Electronic Systems}
}
"""
FAULTS = (
    "Labels of photos are propagated from a few that a person drew: those of another source than `seed` were never "
    "looked at one by one. `confidence` says how sure each is.",
    "Small rocks, rocks at the border of a photo and shadows in dark photos are missed most.",
    "What a scan did not see of a rock or of the ground is filled in smoothly; meshes there are a guess.",
    "Boxes of rocks are where people draw them; a mask may reach beyond its box or leave some of it.",
    "Twins have one set of reflectance parameters for all sand; grain by grain they differ from photos.",
    "The sensor's noise is that of a camera like NASA's: nobody published the camera's own.",
    "One sandbox, one rig, one kind of lamp: nothing here says how a method does on the Moon.",
)


def title(catalogue: Catalogue) -> str:
    return f"polarsim run {catalogue.name}"


def split_of(catalogue: Catalogue) -> str:
    """The split whose parts pictures have, in a sentence."""
    if not catalogue.split:
        return "The run drew no split: pictures are in no part."
    return f"Parts (train, val, test) are those of the run's split by {catalogue.split}."


def what_it_is(catalogue: Catalogue) -> str:
    """In two sentences, honest about where pictures come from."""
    source = {
        "analog": "pictures of an analog sandbox that polarsim generated, in the place of NASA's photos",
        "polar": "photos of NASA's POLAR data set",
        "release": "the published POLAR-Sim labels and meshes, without NASA's photos",
    }[catalogue.kind]
    twins = [domain for domain in catalogue.domains if domain != catalogue.photo_domain]
    rendered = f", and ray-traced twins of them ({', '.join(twins)})" if twins else ""
    return (
        f"Rocks and shadows under low light, as in the polar regions of the Moon: {source}{rendered}. "
        "Every picture has boxes and masks of rocks and their shadows, the pose of its camera and the places of lamps."
    )


def licences(catalogue: Catalogue) -> tuple[tuple[str, str, str], ...]:
    """What is licensed, how, where the text stands; without NASA's photos where none are published."""
    return LICENCES if "real" in catalogue.domains else LICENCES[:2]


def licence_urls(catalogue: Catalogue) -> list[str]:
    return list(dict.fromkeys(url for _, _, url in licences(catalogue)))
