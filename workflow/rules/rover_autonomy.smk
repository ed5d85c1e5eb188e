"""Drives in which the rover finds its own way: one of every mode, Sun, exposure and seed; their table and figure."""


rule rover_autonomy:
    """Everything of these drives; nothing where the configuration has none."""
    input:
        of_run("results/{run}/tables/rover_autonomy.csv") if AUTONOMY_CASES else [],
        of_run("results/{run}/figures/rover_autonomy.png") if AUTONOMY_CASES else [],


rule drive_alone:
    """One drive in which the rover looks, maps, plans and steers, and what it was like."""
    input:
        meshes=of_terrains_driven("results/{{run}}/meshes/Terrain{terrain}"),
        dem=elevation_model(),
        vehicle=str(ROVER.drive.vehicle),
        soils=str(ROVER.soil.table),
        weights=weights_of_case,
    output:
        figures="results/{run}/rover/autonomy/{case}/figures.parquet",
        trace="results/{run}/rover/autonomy/{case}/trace.parquet",
        map="results/{run}/rover/autonomy/{case}/map.npz",
        drive="results/{run}/rover/autonomy/{case}/drive.json",
    log:
        "results/{run}/logs/rover/drive_alone_{case}.log",
    benchmark:
        "results/{run}/benchmarks/rover/drive_alone_{case}.tsv"
    resources:
        mem_mb=growing(3000),
        runtime=60,
    params:
        world=options("rover.world"),
        soil=options("rover.soil"),
        drive_options=options("rover.drive"),
        options=ROVER.autonomy.model_dump(mode="json", exclude=OTHER_DRIVES),
        onboard=camera_suite_options()["onboard"],
        code=code_of("drive_alone"),
    script:
        "../scripts/drive_alone.py"


rule summarise_autonomy:
    """Every drive's figures, and the means of modes and lights over seeds with intervals."""
    input:
        drives=autonomy_of("figures.parquet"),
    output:
        each="results/{run}/rover/every_autonomy.parquet",
        together="results/{run}/rover/autonomy.parquet",
    log:
        "results/{run}/logs/rover/summarise_autonomy.log",
    benchmark:
        "results/{run}/benchmarks/rover/summarise_autonomy.tsv"
    resources:
        mem_mb=growing(1000),
        runtime=10,
    params:
        code=code_of("summarise_autonomy"),
    script:
        "../scripts/summarise_autonomy.py"


rule tabulate_autonomy:
    """Drives in which the rover decides, by mode and light."""
    input:
        together="results/{run}/rover/autonomy.parquet",
    output:
        table=shown(
            "results/{run}/tables/rover_autonomy.csv",
            "Rover",
            caption="tables/rover_autonomy",
            picture="finding its way",
        ),
        others=multiext("results/{run}/tables/rover_autonomy", ".md", ".tex", ".parquet"),
    log:
        "results/{run}/logs/rover/tabulate_autonomy.log",
    benchmark:
        "results/{run}/benchmarks/rover/tabulate_autonomy.tsv"
    resources:
        mem_mb=growing(500),
        runtime=5,
    params:
        origin=ORIGIN,
        code=code_of("tabulate_autonomy"),
    script:
        "../scripts/tabulate_autonomy.py"


rule draw_autonomy:
    """Ways of all modes over the rocks, and collisions, success and energy of the modes side by side."""
    input:
        drives=autonomy_of("trace.parquet"),
        together="results/{run}/rover/autonomy.parquet",
    output:
        figure=shown("results/{run}/figures/rover_autonomy.png", "Rover", picture="finding its way"),
    log:
        "results/{run}/logs/rover/draw_autonomy.log",
    benchmark:
        "results/{run}/benchmarks/rover/draw_autonomy.tsv"
    resources:
        mem_mb=growing(1000),
        runtime=5,
    params:
        origin=ORIGIN,
        code=code_of("draw_autonomy"),
    script:
        "../scripts/draw_autonomy.py"
