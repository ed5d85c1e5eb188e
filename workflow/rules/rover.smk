"""Stage 8: drives over the digitised terrains: physics, pictures, what a detector sees on board, bags, tables, figures."""

from polarsim.rover.cameras.options import rover_render
from polarsim.rover.vehicle.mounts import FRONT

ROVER = CONFIG.rover


def of_drives(pattern, **wildcards):
    """Files of all drives of this run."""
    return of_run(pattern, seed=DRIVES.seeds, **wildcards)


rule rover:
    """Everything of this stage; nothing where the configuration does not drive."""
    input:
        of_drives("results/{run}/rover/seed{seed}/{name}", name=["trace.parquet", "drive.json"]),
        of_drives("results/{run}/rover/seed{seed}/{view}/poses.parquet", view=DRIVES.views),
        of_drives("results/{run}/rover/seed{seed}/{view}/{sun}_coco.json", view=DRIVES.views, sun=DRIVES.suns),
        of_drives("results/{run}/rover/seed{seed}/drive.mcap") if ROVER.bags else [],
        of_drives("results/{run}/rover/seed{seed}/videos") if ROVER.cameras.videos else [],
        of_run("results/{run}/rover/rover.urdf") if DRIVES.seeds else [],
        of_run("results/{run}/tables/{name}.csv", name=DRIVES.tables) if DRIVES.seeds else [],
        of_run("results/{run}/figures/{name}.png", name=DRIVES.figures) if DRIVES.seeds else [],


rule drive_rover:
    """One drive: terrains side by side or an elevation model as one deformable ground, rocks on it, the rover along its
    path."""
    input:
        meshes=expand("results/{{run}}/meshes/Terrain{terrain}", terrain=DRIVES.terrains),
        dem=DRIVES.elevation_model,  # read through params.world
        vehicle=str(ROVER.drive.vehicle),  # read through params.drive
        soils=str(ROVER.soil.table),  # read through params.soil
    output:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # written through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # written through trace
        # written through trace
        world=multiext("results/{run}/rover/seed{seed}/world/", "ground.npz", "rocks.npz", "rocks.parquet"),
    resources:
        mem_mb=growing(2000),
        runtime=60,
    params:
        world=options("rover.world"),
        soil=options("rover.soil"),
        drive=options("rover.drive"),
    script:
        "../scripts/drive_rover.py"


rule see_drive:
    """The pictures of one view of a drive: every Sun, model and exposure from the same rays, and what is in them."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # read through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        vehicle=str(ROVER.drive.vehicle),
    output:
        poses="results/{run}/rover/seed{seed}/{view}/poses.parquet",  # written through trace
        # written through trace
        truth=expand("results/{{run}}/rover/seed{{seed}}/{{view}}/{sun}_truth.parquet", sun=DRIVES.suns),
        # written through trace
        annotations=expand("results/{{run}}/rover/seed{{seed}}/{{view}}/{sun}_coco.json", sun=DRIVES.suns),
    resources:
        mem_mb=growing(4000),
        runtime=720,
    params:
        options=DRIVES.camera_options("views", "onboard", "videos"),  # other views and later steps change no picture
        render=rover_render(CONFIG.render),
    script:
        "../scripts/see_drive.py"


rule make_drive_dataset:
    """Windows of the front camera's pictures of other drives, to fine-tune the detector on board on."""
    input:
        poses=DRIVES.poses_of_other_drives(),  # read through params.options
    output:
        dataset=directory("results/{run}/rover/fine_tuning"),
    resources:
        mem_mb=growing(1000),
        runtime=60,
    params:
        options=ROVER.fine_tuning.model_dump(mode="json", exclude={"epochs"}),
    script:
        "../scripts/make_drive_dataset.py"


rule fine_tune_on_drives:
    """The detector on board, trained on pictures of other drives."""
    input:
        dataset="results/{run}/rover/fine_tuning",
        start=DRIVES.weights_before_fine_tuning,
    output:
        weights="results/{run}/rover/fine_tuned.pt",
        curve="results/{run}/rover/fine_tuned.csv",
    resources:
        mem_mb=growing(2500),
        runtime=720,
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("rover.fine_tuning"),
        prediction=DRIVES.validation_options(),
        work="results/{run}/rover/fine_tuning_work",
    script:
        "../scripts/fine_tune_on_drives.py"


rule detect_drive:
    """What a detector finds in the front camera's pictures."""
    input:
        poses=f"results/{{run}}/rover/seed{{seed}}/{FRONT}/poses.parquet",
        # read through poses
        truth=expand(f"results/{{{{run}}}}/rover/seed{{{{seed}}}}/{FRONT}/{{sun}}_truth.parquet", sun=DRIVES.suns),
        vehicle=str(ROVER.drive.vehicle),
        weights=DRIVES.weights,  # read through params.detector
    output:
        detections=DRIVES.detections(),  # written through poses
    resources:
        mem_mb=growing(3000),
        runtime=240,
    params:
        options=DRIVES.camera_options("videos"),
        detector=DRIVES.detector_options(),
    script:
        "../scripts/detect_drive.py"


rule measure_drive:
    """What the front camera is worth on board: sightings, stable ones, the map of hazards, stops."""
    input:
        poses=f"results/{{run}}/rover/seed{{seed}}/{FRONT}/poses.parquet",
        # read through poses
        truth=expand(f"results/{{{{run}}}}/rover/seed{{{{seed}}}}/{FRONT}/{{sun}}_truth.parquet", sun=DRIVES.suns),
        vehicle=str(ROVER.drive.vehicle),
        detections=DRIVES.detections(),  # read through poses
    output:
        # written through poses
        tables=expand(
            "results/{{run}}/rover/seed{{seed}}/onboard/{name}.parquet", name=["sightings", "stable", "map", "stops"]
        ),
    resources:
        mem_mb=growing(2000),
        runtime=30,
    params:
        options=DRIVES.camera_options("videos"),
        detector=DRIVES.detector_options(),
    script:
        "../scripts/measure_drive.py"


rule film_drive:
    """Videos of every view, Sun, model and exposure, the front camera's with what the detector finds."""
    input:
        pictures=DRIVES.pictures_of_drive(),  # read through videos
        detections=DRIVES.detections(),  # read through videos
        vehicle=str(ROVER.drive.vehicle),
    output:
        videos=directory("results/{run}/rover/seed{seed}/videos"),
    threads: 2
    resources:
        mem_mb=growing(2000),
        runtime=720,
    params:
        options=DRIVES.camera_options(),
    script:
        "../scripts/film_drive.py"


rule write_bag:
    """A drive as messages of ROS 2 in an MCAP file."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        pictures=DRIVES.pictures_of_drive(),  # read through trace
        detections=DRIVES.detections(),  # read through trace
        vehicle=str(ROVER.drive.vehicle),
    output:
        bag="results/{run}/rover/seed{seed}/drive.mcap",
    resources:
        mem_mb=growing(1500),
        runtime=60,
    params:
        options=options("rover.bag"),
    script:
        "../scripts/write_bag.py"


rule write_urdf:
    """The rover as other simulators read it."""
    input:
        vehicle=str(ROVER.drive.vehicle),
    output:
        urdf="results/{run}/rover/rover.urdf",
    resources:
        mem_mb=growing(500),
        runtime=5,
    script:
        "../scripts/write_urdf.py"


rule summarise_drives:
    """Slip, sinkage, torque, energy, offset and rocks of every drive, and of all with intervals."""
    input:
        drives=of_drives("results/{run}/rover/seed{seed}/drive.json"),
        traces=of_drives("results/{run}/rover/seed{seed}/trace.parquet"),  # read through drives
    output:
        each="results/{run}/rover/every_drive.parquet",
        together="results/{run}/rover/drives.parquet",
    resources:
        mem_mb=growing(1000),
        runtime=10,
    script:
        "../scripts/summarise_drives.py"


rule summarise_onboard:
    """What is seen on board over all drives and Suns, with intervals."""
    input:
        tables=of_drives("results/{run}/rover/seed{seed}/onboard/stops.parquet"),
    output:
        table="results/{run}/rover/onboard.parquet",
    resources:
        mem_mb=growing(1000),
        runtime=20,
    script:
        "../scripts/summarise_onboard.py"


rule tabulate_rover:
    """Tabulate drives, together and one by one."""
    input:
        drives="results/{run}/rover/drives.parquet",
        each="results/{run}/rover/every_drive.parquet",
    output:
        table=shown("results/{run}/tables/rover.csv", "Rover", picture="drives"),
        each_table=shown(
            "results/{run}/tables/rover_drives.csv", "Rover", caption="tables/rover", picture="every drive"
        ),
        # written through table
        others=expand(
            "results/{{run}}/tables/{name}.{form}",
            name=["rover", "rover_drives"],
            form=["md", "tex", "parquet"],
        ),
    resources:
        mem_mb=growing(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_rover.py"


rule tabulate_onboard:
    """What the front camera is worth on board."""
    input:
        onboard="results/{run}/rover/onboard.parquet",
    output:
        table=shown("results/{run}/tables/rover_onboard.csv", "Rover", picture="on board"),
        others=multiext("results/{run}/tables/rover_onboard", ".md", ".tex", ".parquet"),  # written through table
    resources:
        mem_mb=growing(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_onboard.py"


rule draw_drive:
    """Slip, sinkage and offset over time."""
    input:
        traces=of_drives("results/{run}/rover/seed{seed}/trace.parquet"),
    output:
        figure=shown("results/{run}/figures/rover_drive.png", "Rover", picture="slip and sinkage"),
    resources:
        mem_mb=growing(1000),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/draw_drive.py"


rule draw_sequence:
    """Moments of the first drive, from behind the rover where such a view is taken."""
    input:
        poses=f"{DRIVES.first}/{ROVER.shown_view}/poses.parquet",
    output:
        figure=shown("results/{run}/figures/rover_sequence.png", "Rover", picture="the drive"),
    resources:
        mem_mb=growing(1000),
        runtime=5,
    params:
        pictures=ROVER.shown_set,
    script:
        "../scripts/draw_sequence.py"


rule draw_front:
    """What the front camera sees on the first drive, with the rocks that are there and those that a detector finds."""
    input:
        poses=f"{DRIVES.first}/{FRONT}/poses.parquet",
        truth=f"{DRIVES.first}/{FRONT}/{DRIVES.shown_sun}_truth.parquet",
        detections=DRIVES.shown_detections(),
    output:
        figure=shown("results/{run}/figures/rover_front.png", "Rover", picture="front camera"),
    resources:
        mem_mb=growing(1000),
        runtime=5,
    params:
        pictures=ROVER.shown_set,
        confidence=ROVER.cameras.onboard.confidence,
    script:
        "../scripts/draw_front.py"
