"""Files and options of the drives: what each step reads, and which set of pictures figures show."""

from polarsim.rover.cameras.options import rover_render
from polarsim.rover.planning.cases import UNLIT, cases
from polarsim.rover.vehicle.mounts import FRONT

ROVER = CONFIG.rover
RIDES = [str(seed) for seed in ROVER.seeds] if ROVER.run else []
ROVER_TABLES = ["rover", "rover_drives"]
ROVER_TABLES += ["rover_onboard"] if ROVER.onboard else []
ROVER_FIGURES = ["rover_sequence", "rover_drive"]
ROVER_FIGURES += ["rover_front"] if ROVER.onboard else []
DECIDING = CONFIG.deciding_detectors(Path(f"results/{RUN}"))
AUTONOMY_CASES = {}
if ROVER.run and ROVER.autonomy.run:
    driven = cases(ROVER.autonomy, ROVER.cameras, ROVER.seeds, list(DECIDING))
    AUTONOMY_CASES = {case.name: case for case in driven}
DETECTORS_DRIVEN = {case.detector for case in AUTONOMY_CASES.values()} & set(DECIDING)
# Their figures of the gap: those of the run's own trainings, not of weights that come from elsewhere.
HAVE_GAP = bool(set(ROVER.autonomy.detectors) & set(TRAINED))
VIEWS_DRIVEN, SUNS = list(ROVER.cameras.views), list(ROVER.suns)


wildcard_constraints:
    view=one_of(VIEWS_DRIVEN),
    case=one_of(AUTONOMY_CASES),


# What a drive's pictures do not depend on: other views, and what is made of the pictures.
AFTER_PICTURES = ("views", "onboard", "videos")
RUN_FOLDER = Path(f"results/{RUN}")
DETECTOR_ON_BOARD = CONFIG.detector_on_board(RUN_FOLDER)  # None: truth alone is measured


def camera_suite_options(*left_out):
    """Options of a drive's pictures, without some."""
    return ROVER.cameras.model_dump(mode="json", exclude=set(left_out))


def detector_before_drives(wildcards):
    """The detector that is trained on other drives."""
    return str(CONFIG.detector_before_drives(RUN_FOLDER).weights)


def detector_options():
    """Options of the detector on board; None if there is none."""
    return DETECTOR_ON_BOARD and DETECTOR_ON_BOARD.model_dump(mode="json")


def poses_of_other_drives():
    """A file of each drive that the detector on board is trained on: the last that is written with its pictures."""
    return [f"{drive}/{FRONT}/poses.parquet" for drive in ROVER.fine_tuning.drives]


def of_drive(*names, **wildcards):
    """Files of a drive, by their names in its folder."""
    return expand(
        "results/{{run}}/rover/seed{{seed}}/{name}",
        name=[one for name in names for one in expand(name, **wildcards)],
    )


def of_drives(*names, **wildcards):
    """The same of all drives of this run."""
    return [path.format(run=RUN, seed=seed) for seed in RIDES for path in of_drive(*names, **wildcards)]


def of_first_drive(name):
    """A file of the first drive: what figures show."""
    return f"results/{{run}}/rover/seed{ROVER.seeds[0]}/{name}"


def of_terrains_driven(pattern):
    """Files of the terrains that are driven over, from east to west."""
    return expand(pattern, terrain=[f"{terrain:02d}" for terrain in ROVER.world.terrains])


def elevation_model():
    """The file with the heights of the ground that is driven over, where the configuration names one."""
    dem = ROVER.world.dem
    return str(dem.path) if dem and dem.path else []


def shown_sun():
    """The Sun under which figures show a drive."""
    return ROVER.shown_set.split("_")[0]


def shown_detections(wildcards):
    """What a detector found in the pictures that are shown, where one looked."""
    if DETECTOR_ON_BOARD is None:
        return []
    return of_first_drive(f"{FRONT}/{ROVER.shown_set}/detections.parquet").format(run=wildcards.run)


def pictures_of_drive(wildcards):
    """Every view's cameras and labels, which are written when its pictures are."""
    names = of_drive(
        "{view}/poses.parquet",
        "{view}/{sun}_truth.parquet",
        view=VIEWS_DRIVEN,
        sun=SUNS,
    )
    return [name.format(run=wildcards.run, seed=wildcards.seed) for name in names]


def detections_on_board():
    """What the detector found in each set of the front camera's pictures."""
    return of_drive(f"{FRONT}/{{pictures}}/detections.parquet", pictures=list(ROVER.picture_sets))


def detections_of_drive(wildcards):
    """The same, where a detector looks."""
    if not ROVER.onboard or DETECTOR_ON_BOARD is None:
        return []
    return [name.format(run=wildcards.run, seed=wildcards.seed) for name in detections_on_board()]


# What a single drive does not depend on: which others there are. More seeds or Suns leave finished drives as they are.
OTHER_DRIVES = {"run", "modes", "headlights", "auto_exposure", "detectors"}


def autonomy_of(name):
    """A file of every such drive."""
    return expand("results/{{run}}/rover/autonomy/{case}/{name}", case=AUTONOMY_CASES, name=name)


def cameras_of_case(wildcards):
    """Options of `rover.cameras` that change a drive: those of its pictures, where it takes some, and of its boxes."""
    lit = AUTONOMY_CASES[wildcards.case].mode not in UNLIT
    pictures = {"sun_elevation_deg", "scale", "stars"} if lit else set()
    return ROVER.cameras.model_dump(
        mode="json", include=dict.fromkeys(pictures, True) | {"onboard": {"confidence", "ground"}}
    )


def render_of_case(wildcards):
    """Options of `render` that change a drive: those of its pictures, where it takes some."""
    options = rover_render(CONFIG.render)
    return {"skirt_m": options["skirt_m"]} if AUTONOMY_CASES[wildcards.case].mode in UNLIT else options


def detector_of_case(wildcards):
    """The detector, of modes that have one."""
    detector = DECIDING.get(AUTONOMY_CASES[wildcards.case].detector)
    return detector and detector.model_dump(mode="json")


def weights_of_case(wildcards):
    """The detector's file, of modes that have one: others do not wait for it."""
    detector = DECIDING.get(AUTONOMY_CASES[wildcards.case].detector)
    return str(detector.weights) if detector else []
