"""Drives over the digitised terrains: physics, images, detections on board, bags, tables and figures."""

from polarsim.rover.cameras.options import rover_render
from polarsim.rover.vehicle.camera_names import FRONT

ROVER = CONFIG.rover
NO_DRIVES = "no drives, expected rover.run: true"


rule rover:
    """All outputs of this stage; empty without drives."""
    input:
        of_drives("results/{run}/rover/seed{seed}/{name}", name=["trace.parquet", "drive.json"]),
        of_drives("results/{run}/rover/seed{seed}/localisation/{name}.parquet", name=["sensors", "estimates"]),
        of_drives("results/{run}/rover/seed{seed}/{view}/poses.parquet", view=DRIVES.views),
        of_drives("results/{run}/rover/seed{seed}/{view}/{sun}_coco.json", view=DRIVES.views, sun=DRIVES.suns),
        of_drives("results/{run}/rover/seed{seed}/drive.mcap") if ROVER.bags else [],
        of_drives("results/{run}/rover/seed{seed}/videos") if ROVER.cameras.videos else [],
        of_run("results/{run}/rover/rover.urdf") if DRIVES.seeds else [],
        of_run("results/{run}/tables/{name}.csv", name=DRIVES.tables) if DRIVES.seeds else [],
        of_run("results/{run}/figures/{name}.png", name=DRIVES.figures) if DRIVES.seeds else [],


rule cut_rocks:
    """Convex parts of the rocks for all drives along a path (`path`) or all autonomous drives (`autonomy`)."""
    input:
        meshes=DRIVES.meshes,
        dem=DRIVES.elevation_model,  # read through params.world
    output:
        parts="results/{run}/rover/rock_parts/{drives}.npz",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=60,
    params:
        world=options("rover.world"),
        path_m=ROVER.drive.path_m,
        autonomous_width_m=DRIVES.width_of_drives,
    script:
        "../scripts/cut_rocks.py"


rule drive_rover:
    """Physics of one drive: rover on deformable ground, composed of terrains or an elevation model, with rocks."""
    input:
        meshes=DRIVES.meshes,
        dem=DRIVES.elevation_model,  # read through params.world
        parts="results/{run}/rover/rock_parts/path.npz",
        vehicle=DRIVES.vehicle,  # read through params.drive
        soils=DRIVES.soils,  # read through params.soil
    output:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # written through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # written through trace
        # written through trace
        world=multiext("results/{run}/rover/seed{seed}/world/", "ground.npz", "rocks.npz", "rocks.parquet"),
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=60,
    params:
        world=options("rover.world"),
        soil=options("rover.soil"),
        drive=options("rover.drive"),
    script:
        "../scripts/drive_rover.py"


rule read_sensors:
    """Readings of wheels and IMU in a drive, and the calibration of all sensors."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # read through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        vehicle=DRIVES.vehicle,
    output:
        sensors="results/{run}/rover/seed{seed}/localisation/sensors.parquet",  # written through trace
        calibration="results/{run}/rover/seed{seed}/localisation/calibration.json",  # written through trace
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        views=DRIVES.views,
        scale=ROVER.cameras.scale,
    script:
        "../scripts/read_sensors.py"


rule render_drive:
    """Images of one view of a drive for every Sun, model and exposure from the same rays, and labels."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # read through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        vehicle=DRIVES.vehicle,
    output:
        poses="results/{run}/rover/seed{seed}/{view}/poses.parquet",  # written through trace
        # written through trace
        truth=expand("results/{{run}}/rover/seed{{seed}}/{{view}}/{sun}_truth.parquet", sun=DRIVES.suns),
        # written through trace
        annotations=expand("results/{{run}}/rover/seed{{seed}}/{{view}}/{sun}_coco.json", sun=DRIVES.suns),
    resources:
        mem_mb=memory_per_attempt(4000),
        runtime=720,
    params:
        options=DRIVES.camera_options("views", "onboard", "videos"),  # images do not depend on other views and later steps
        render=rover_render(CONFIG.render),
    script:
        "../scripts/render_drive.py"


rule make_drive_dataset:
    """Windows of front camera images of other drives, for fine-tuning of the detector on board."""
    input:
        poses=DRIVES.poses_of_other_drives(),  # read through params.options
    output:
        dataset=directory("results/{run}/rover/fine_tuning"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=60,
    params:
        options=ROVER.fine_tuning.model_dump(mode="json", exclude={"epochs"}),
    script:
        "../scripts/make_drive_dataset.py"


rule fine_tune_on_drives:
    """Detector on board, fine-tuned on images of other drives."""
    input:
        dataset="results/{run}/rover/fine_tuning",
        start=DRIVES.weights_before_fine_tuning,
    output:
        weights="results/{run}/rover/fine_tuned.pt",
        curve="results/{run}/rover/fine_tuned.csv",
    resources:
        mem_mb=memory_per_attempt(2500),
        runtime=720,
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("rover.fine_tuning"),
        prediction=DRIVES.validation_options(),
        work=placed("results/{run}/rover/fine_tuning_work"),
    script:
        "../scripts/fine_tune_on_drives.py"


rule localise_drive:
    """Poses of a drive estimated from its sensors, with the stereo pair in each set of images if there is one."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        tracks="results/{run}/rover/seed{seed}/tracks.npz",  # read through trace
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        calibration="results/{run}/rover/seed{seed}/localisation/calibration.json",  # read through trace
        pictures=DRIVES.pictures_of_drive(),  # read through trace
        vehicle=DRIVES.vehicle,
    output:
        estimates="results/{run}/rover/seed{seed}/localisation/estimates.parquet",  # written through trace
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=60,
    params:
        picture_sets=DRIVES.picture_sets,
    script:
        "../scripts/localise_drive.py"


rule detect_drive:
    """Detections in the front camera images."""
    input:
        poses=f"results/{{run}}/rover/seed{{seed}}/{FRONT}/poses.parquet",
        # read through poses
        truth=expand(f"results/{{{{run}}}}/rover/seed{{{{seed}}}}/{FRONT}/{{sun}}_truth.parquet", sun=DRIVES.suns),
        vehicle=DRIVES.vehicle,
        weights=DRIVES.weights,  # read through params.detector
    output:
        detections=DRIVES.detections(),  # written through poses
    resources:
        mem_mb=memory_per_attempt(3000),
        runtime=240,
    params:
        options=DRIVES.camera_options("videos"),
        detector=DRIVES.detector_options(),
    script:
        "../scripts/detect_drive.py"


rule measure_drive:
    """Metrics of the front camera: sightings, stable detections, hazard map, stops."""
    input:
        poses=f"results/{{run}}/rover/seed{{seed}}/{FRONT}/poses.parquet",
        # read through poses
        truth=expand(f"results/{{{{run}}}}/rover/seed{{{{seed}}}}/{FRONT}/{{sun}}_truth.parquet", sun=DRIVES.suns),
        vehicle=DRIVES.vehicle,
        detections=DRIVES.detections(),  # read through poses
    output:
        # written through poses
        tables=expand(
            "results/{{run}}/rover/seed{{seed}}/onboard/{name}.parquet", name=["sightings", "stable", "map", "stops"]
        ),
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=30,
    params:
        options=DRIVES.camera_options("videos"),
        detector=DRIVES.detector_options(),
    script:
        "../scripts/measure_drive.py"


rule film_drive:
    """Videos of every view, Sun, model and exposure; front camera videos with detections."""
    input:
        pictures=DRIVES.pictures_of_drive(),  # read through videos
        detections=DRIVES.detections(),  # read through videos
        vehicle=DRIVES.vehicle,
    output:
        videos=directory("results/{run}/rover/seed{seed}/videos"),
    threads: 2
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=720,
    params:
        options=DRIVES.camera_options(),
    script:
        "../scripts/film_drive.py"


rule write_bag:
    """ROS 2 messages of a drive in an MCAP file."""
    input:
        trace="results/{run}/rover/seed{seed}/trace.parquet",
        drive="results/{run}/rover/seed{seed}/drive.json",  # read through trace
        sensors="results/{run}/rover/seed{seed}/localisation/sensors.parquet",  # read through trace
        estimates="results/{run}/rover/seed{seed}/localisation/estimates.parquet",  # read through trace
        pictures=DRIVES.pictures_of_drive(),  # read through trace
        detections=DRIVES.detections(),  # read through trace
        vehicle=DRIVES.vehicle,
    output:
        bag="results/{run}/rover/seed{seed}/drive.mcap",
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=60,
    params:
        options=options("rover.bag"),
    script:
        "../scripts/write_bag.py"


rule write_urdf:
    """URDF of the rover for other simulators."""
    input:
        vehicle=DRIVES.vehicle,
    output:
        urdf="results/{run}/rover/rover.urdf",
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/write_urdf.py"


rule summarise_drives:
    """Slip, sinkage, torque, energy, offset and rocks of every drive, and means with intervals, with tables."""
    input:
        drives=required(of_drives("results/{run}/rover/seed{seed}/drive.json"), NO_DRIVES),
        traces=of_drives("results/{run}/rover/seed{seed}/trace.parquet"),  # read through drives
    output:
        each="results/{run}/rover/drive_metrics.parquet",
        together="results/{run}/rover/drives.parquet",
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
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        origin=ORIGIN,
    script:
        "../scripts/summarise_drives.py"


rule summarise_onboard:
    """Metrics on board over all drives and Suns, with intervals, and their table."""
    input:
        tables=required(of_drives("results/{run}/rover/seed{seed}/onboard/stops.parquet"), NO_DRIVES),
    output:
        onboard="results/{run}/rover/onboard.parquet",
        table=shown("results/{run}/tables/rover_onboard.csv", "Rover", picture="on board"),
        others=multiext("results/{run}/tables/rover_onboard", ".md", ".tex", ".parquet"),  # written through table
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=20,
    params:
        origin=ORIGIN,
    script:
        "../scripts/summarise_onboard.py"


rule draw_drive:
    """Slip, sinkage and offset over time; images of the first drive, from a view that follows the rover if available."""
    input:
        traces=of_drives("results/{run}/rover/seed{seed}/trace.parquet"),
        poses=f"{DRIVES.first}/{ROVER.shown_view}/poses.parquet",
    output:
        figure=shown("results/{run}/figures/rover_drive.png", "Rover", picture="slip and sinkage"),
        sequence=shown("results/{run}/figures/rover_sequence.png", "Rover", picture="the drive"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        origin=ORIGIN,
        pictures=ROVER.shown_set,
    script:
        "../scripts/draw_drive.py"


rule draw_front:
    """Front camera images of the first drive with true rocks and detections."""
    input:
        poses=f"{DRIVES.first}/{FRONT}/poses.parquet",
        truth=f"{DRIVES.first}/{FRONT}/{DRIVES.shown_sun}_truth.parquet",
        detections=DRIVES.shown_detections(),
    output:
        figure=shown("results/{run}/figures/rover_front.png", "Rover", picture="front camera"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        pictures=ROVER.shown_set,
        confidence=ROVER.cameras.onboard.confidence,
    script:
        "../scripts/draw_front.py"
