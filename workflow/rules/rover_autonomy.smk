"""Autonomous drives by mode, pose, Sun, exposure, lights, model, detector and seed; tables and figures."""


rule rover_autonomy:
    """All outputs of autonomous drives; empty without such drives."""
    input:
        of_run("results/{run}/tables/rover_autonomy.csv") if DRIVES.cases else [],
        of_run("results/{run}/figures/rover_autonomy.png") if DRIVES.cases else [],
        of_run("results/{run}/figures/rover_maps.png") if DRIVES.cases else [],
        of_run("results/{run}/tables/rover_rank.csv") if len(DRIVES.detectors_driven) > 1 else [],


rule drive_alone:
    """One drive with perception, mapping, planning and steering, and its metrics."""
    input:
        meshes=DRIVES.meshes,
        dem=DRIVES.elevation_model,  # read through params.world
        parts="results/{run}/rover/rock_parts/autonomy.npz",
        vehicle=DRIVES.vehicle,  # read through params.drive_options
        soils=DRIVES.soils,  # read through params.soil
        weights=DRIVES.weights_of_case,  # read through params.detector
    output:
        figures="results/{run}/rover/autonomy/{case}/figures.parquet",
        trace="results/{run}/rover/autonomy/{case}/trace.parquet",  # written through figures
        map="results/{run}/rover/autonomy/{case}/map.npz",  # written through figures
        events="results/{run}/rover/autonomy/{case}/events.parquet",  # written through figures
        pictures=directory("results/{run}/rover/autonomy/{case}/pictures"),  # written through figures
        # written through figures
        localisation=directory("results/{run}/rover/autonomy/{case}/localisation"),
        drive="results/{run}/rover/autonomy/{case}/drive.json",  # written through figures
    wildcard_constraints:
        case=one_of(DRIVES.cases_without_pictures),
    resources:
        mem_mb=memory_per_attempt(3000),
        runtime=60,
    params:
        world=options("rover.world"),
        soil=options("rover.soil"),
        drive_options=options("rover.drive"),
        options=DRIVES.autonomy_options(),
        cameras=DRIVES.cameras_of_case,
        render=DRIVES.render_of_case,
        detector=DRIVES.detector_of_case,
    script:
        "../scripts/drive_alone.py"


# Drives with images take two to four times as long and start first, so that no core waits for the last of them.
use rule drive_alone as drive_with_pictures with:
    wildcard_constraints:
        case=one_of(DRIVES.cases, but=DRIVES.cases_without_pictures),
    priority: 1


rule summarise_autonomy:
    """Metrics of every drive, means over seeds with intervals, and effects of each axis, with tables."""
    input:
        drives=required(
            expand("results/{{run}}/rover/autonomy/{case}/figures.parquet", case=DRIVES.cases),
            "no autonomous drives, expected rover.run: true and rover.autonomy.run: true",
        ),
    output:
        each="results/{run}/rover/autonomy_metrics.parquet",
        together="results/{run}/rover/autonomy.parquet",
        effects="results/{run}/rover/autonomy_effects.parquet",
        table=shown("results/{run}/tables/rover_autonomy.csv", "Rover", picture="finding its way"),
        effects_table=shown(
            "results/{run}/tables/rover_autonomy_effects.csv", "Rover", picture="what the light changes"
        ),
        # written through table
        others=expand(
            "results/{{run}}/tables/{name}.{form}",
            name=["rover_autonomy", "rover_autonomy_effects"],
            form=["md", "tex", "parquet"],
        ),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        origin=ORIGIN,
    script:
        "../scripts/summarise_autonomy.py"


rule rank_detectors:
    """Ranks of detectors by gap and by drive metrics, and their correlation, with a table."""
    input:
        each="results/{run}/rover/autonomy_metrics.parquet",
        detection="results/{run}/detect/detection.parquet" if DRIVES.has_gap else [],
        ipd="results/{run}/detect/ipd.parquet" if DRIVES.has_gap else [],
    output:
        by_detector="results/{run}/rover/autonomy_detectors.parquet",
        ranks="results/{run}/rover/autonomy_rank.parquet",
        table=shown("results/{run}/tables/rover_rank.csv", "Rover", picture="gap and drive"),
        others=multiext("results/{run}/tables/rover_rank", ".md", ".tex", ".parquet"),  # written through table
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        pair=[CONFIG.photo_domain, ROVER.cameras.models[0]],
        split=SPLITS[0],
        origin=ORIGIN,
    script:
        "../scripts/rank_detectors.py"


rule draw_autonomy:
    """Metrics of the modes, the paths of the drives of the first seed, and maps and images of a drive of each mode."""
    input:
        drives=expand("results/{{run}}/rover/autonomy/{case}/trace.parquet", case=DRIVES.cases),
        events=expand("results/{{run}}/rover/autonomy/{case}/events.parquet", case=DRIVES.cases),  # read through drives
        pictures=expand("results/{{run}}/rover/autonomy/{case}/pictures", case=DRIVES.cases),  # read through drives
        together="results/{run}/rover/autonomy.parquet",
    output:
        figure=shown("results/{run}/figures/rover_autonomy.png", "Rover", picture="modes"),
        ways=shown("results/{run}/figures/rover_ways.png", "Rover", picture="ways"),
        maps=shown("results/{run}/figures/rover_maps.png", "Rover", picture="map, way, hits and pictures"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/draw_autonomy.py"
