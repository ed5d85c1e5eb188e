"""Stage 2: where the rig stood at every position of a terrain."""


rule cameras:
    """Everything of this stage."""
    input:
        of_run("results/{run}/cameras/Terrain{terrain}", terrain=TERRAINS),


rule locate_cameras:
    """Rig poses of a terrain: from its scans, or from seed labels and published meshes where there is no scan."""
    input:
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        calibration="results/{run}/acquire/Terrain{terrain}/calibration.json",
        seeds="results/{run}/acquire/Terrain{terrain}/seeds",
    output:
        cameras=directory("results/{run}/cameras/Terrain{terrain}"),
    log:
        "results/{run}/logs/cameras/locate_cameras_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/cameras/locate_cameras_{terrain}.tsv"
    priority: TRAINING_WAITS
    threads: 1
    resources:
        mem_mb=2500,
        runtime=20,
    params:
        positions=positions_here,
        options=options("cameras"),
        code=code_of("cameras.locate"),
    script:
        "../scripts/locate_cameras.py"
