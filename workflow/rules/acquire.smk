"""Stage 1: inventory, photos, calibration and seed labels of every terrain from raw data."""


rule acquire:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/acquire/photos.parquet"),
        of_run("results/{run}/acquire/Terrain{terrain}/inventory.json", terrain=TERRAINS),


if SOURCE.is_generated:

    rule generate_analog:
        """A terrain of the analog sandbox: photos, scans, calibration, seeds and ground truth in NASA's formats."""
        output:
            receipt=f"{CONFIG.source.root}/receipts/Terrain{{terrain}}.json",
        priority: TRAINING_WAITS
        # The first page waits for one terrain.
        threads: lambda wildcards: 2 if wildcards.terrain == PATHS.first_shown else 1
        resources:
            mem_mb=memory_per_attempt(2000),
            runtime=20,  # minutes
        params:
            positions=PATHS.positions,
            grid=options("grid"),
            options=options("analog"),
        script:
            "../scripts/generate_analog.py"

else:

    rule fetch_terrain:
        """Raw data of a terrain, downloaded from the configured URLs, verified and unpacked."""
        output:
            receipt=f"{CONFIG.source.root}/receipts/Terrain{{terrain}}.json",
        priority: TRAINING_WAITS
        resources:
            mem_mb=memory_per_attempt(500),
            runtime=240,  # minutes; an archive has about 0.9 GB
        params:
            source=options("source"),
        script:
            "../scripts/fetch_terrain.py"


rule index_terrain:
    """Inventory of the raw data of a terrain, calibration, and the seed labels for later stages."""
    input:
        raw=PATHS.raw_data,  # read through params.source
    output:
        **converted_photos(),
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        calibration="results/{run}/acquire/Terrain{terrain}/calibration.json",
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        seeds=directory("results/{run}/acquire/Terrain{terrain}/seeds"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        source=options("source"),
        seed_options=CONFIG.labels.model_dump(mode="json")["seeds"],
    script:
        "../scripts/index_terrain.py"


rule merge_photos:
    """Table of all photos."""
    input:
        tables=of_run("results/{run}/acquire/Terrain{terrain}/photos.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/acquire/photos.parquet",
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/merge_photos.py"
