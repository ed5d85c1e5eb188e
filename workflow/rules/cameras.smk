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
        cameras=directory("results/{run}/cameras/located/Terrain{terrain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(1500),
        runtime=20,
    params:
        positions=PATHS.positions,
        options=options("cameras.localisation"),
    script:
        "../scripts/locate_cameras.py"


rule refine_cameras:
    """Poses, lenses and lamps refined on photos in which the meshes are found again; as located without photos."""
    input:
        located="results/{run}/cameras/located/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
    output:
        cameras=directory("results/{run}/cameras/Terrain{terrain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(1500),
        runtime=20,
    params:
        options=options("cameras.refinement"),
    script:
        "../scripts/refine_cameras.py"
