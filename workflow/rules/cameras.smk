"""Stage 2: pose of the rig at every position of a terrain."""


rule cameras:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/cameras/Terrain{terrain}", terrain=TERRAINS),


if PATHS.measures_ranges:

    rule measure_ranges:
        """Range maps of the positions of a terrain from stereo photos, and a calibration corrected by the photos."""
        input:
            photos=PATHS.photos_of_terrain,
            inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
            calibration="results/{run}/acquire/Terrain{terrain}/calibration.json",
        output:
            inventory=PATHS.inventory_of_ranges,
            calibration=PATHS.calibration_of_rig,
            maps=directory(PATHS.range_maps),
        priority: TRAINING_WAITS
        resources:
            mem_mb=memory_per_attempt(2500),
            runtime=20,
        script:
            "../scripts/measure_ranges.py"


rule locate_cameras:
    """Rig poses of a terrain from range maps, or from seed labels and published meshes if the source has none."""
    input:
        inventory=PATHS.inventory_of_ranges,
        calibration=PATHS.calibration_of_rig,
        seeds="results/{run}/acquire/Terrain{terrain}/seeds",
        ranges=PATHS.range_maps,
    output:
        cameras=directory("results/{run}/cameras/located/Terrain{terrain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=20,
    params:
        positions=PATHS.positions,
        options=options("cameras.localisation"),
    script:
        "../scripts/locate_cameras.py"


rule refine_cameras:
    """Poses, lenses and lamps, refined by matching photos with rendered meshes; walls fitted to published photos."""
    input:
        located="results/{run}/cameras/located/Terrain{terrain}",
        meshes=PATHS.unrefined_meshes,
        photos=PATHS.photos_of_terrain,
        covers=COVERS.instead_of_photos("photos"),
        drawn=COVERS.instead_of_photos("drawn"),
    output:
        cameras=directory("results/{run}/cameras/Terrain{terrain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=20,
    params:
        options=options("cameras.refinement"),
    script:
        "../scripts/refine_cameras.py"
