"""Stage 1: raw data to an inventory, photos, calibration and seed labels of every terrain."""


rule acquire:
    """Everything of this stage."""
    input:
        of_run("results/{run}/acquire/photos.parquet"),
        of_run("results/{run}/acquire/Terrain{terrain}/inventory.json", terrain=TERRAINS),


if SOURCE.is_generated:

    rule generate_analog:
        """One terrain of the analog sandbox: photos, scans, calibration, seeds and truth, in NASA's formats."""
        output:
            receipt=f"{CONFIG.source.root}/receipts/Terrain{{terrain}}.json",
        priority: TRAINING_WAITS
        resources:
            mem_mb=growing(2000),
            runtime=20,  # minutes
        params:
            positions=PATHS.positions,
            grid=options("grid"),
            options=options("analog"),
        script:
            "../scripts/generate_analog.py"

else:

    rule fetch_terrain:
        """One terrain's raw data from the addresses of the configuration: resumed, pinned, verified, unpacked."""
        output:
            receipt=f"{CONFIG.source.root}/receipts/Terrain{{terrain}}.json",
        priority: TRAINING_WAITS
        resources:
            mem_mb=growing(500),
            runtime=240,  # minutes; an archive holds about 0.9 GB
        params:
            source=options("source"),
        script:
            "../scripts/fetch_terrain.py"


rule index_terrain:
    """What a terrain's raw data hold, its calibration, and the seed labels that later stages may read."""
    input:
        raw=PATHS.raw_data,  # read through params.source
    output:
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        calibration="results/{run}/acquire/Terrain{terrain}/calibration.json",
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        seeds=directory("results/{run}/acquire/Terrain{terrain}/seeds"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(500),
        runtime=10,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        source=options("source"),
        seed_options=CONFIG.labels.model_dump(mode="json")["seeds"],
    script:
        "../scripts/index_terrain.py"


rule merge_photos:
    """One table of all photos."""
    input:
        tables=of_run("results/{run}/acquire/Terrain{terrain}/photos.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/acquire/photos.parquet",
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(500),
        runtime=5,
    script:
        "../scripts/merge_photos.py"
